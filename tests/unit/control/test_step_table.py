import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from detent.control.step_table import move_stop
from detent.kernel.loop import lay_ready
from detent.methods.stepper_envelope.live import table_params
from detent.planning.step_envelope import StepEnvelope, Zone, ZoneMap
from detent.planning.step_ramp import StepRamp

STEPS = 300
RAMP = StepRamp(np.linspace(400.0, 4000.0, 40))

zones = st.lists(
    st.builds(Zone, st.integers(0, STEPS), st.integers(0, STEPS), st.sampled_from([450.0, 1000.0, 2500.0])), max_size=5
)


@given(zones, st.sampled_from([1, -1]), st.lists(st.integers(0, STEPS), min_size=1, max_size=4))
def test_an_edit_in_the_loop_is_that_of_the_host(limits, direction, stops):
    start = 0 if direction > 0 else STEPS
    table = StepEnvelope(RAMP, ZoneMap(STEPS, 4000.0, limits), direction, start, STEPS - start)
    q, entries, former = table_params(table), lay_ready(table.entries.copy()), table.stop
    for stop in stops:
        written = move_stop(q, entries, former, stop)
        table.move_stop(stop)
        assert np.ctypeslib.as_array(entries).tolist() == table.entries.tolist()
        assert written <= 2 * len(RAMP)
        former = stop


def test_zones_fit_into_the_parameters():
    limits = [Zone(20 * k, 20 * k + 10, 500.0 + k) for k in range(14)]
    q = table_params(StepEnvelope(RAMP, ZoneMap(STEPS, 4000.0, limits), 1, 0, STEPS))
    assert q.stretches == 28
    assert q.edge[q.stretches] == STEPS
    with pytest.raises(IndexError):
        q.edge[32] = 0
