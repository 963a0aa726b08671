import numpy as np
import pytest
from tests.stepper_rig import turn_envelopes

from detent.planning.step_envelope import (
    INDEX_BITS,
    MAX_RAMP,
    SENTINEL,
    StepEnvelope,
    StopEdit,
    Zone,
    ZoneMap,
    envelope_memory,
)
from detent.planning.step_ramp import StepRamp

RAMP = StepRamp(np.array([100.0, 200.0, 300.0, 400.0, 500.0]))
ZONES = (Zone(10, 14, 250.0), Zone(14, 20, 150.0), Zone(30, 31, 60.0))


def reference(caps: list[int], start: int, stop: int) -> list[int]:
    """The specification's loops, upwards, with the end of the travel as a stop of its own."""
    index = list(caps)
    index[-1] = 0
    if start < len(index):
        index[start] = 0
    if stop > 0:
        index[stop - 1] = 0
    for i in range(1, len(index)):
        if i != start:
            index[i] = min(index[i], index[i - 1] + 1)
    for i in reversed(range(len(index) - 1)):
        if i != stop - 1:
            index[i] = min(index[i], index[i + 1] + 1)
    return index


def caps_of(zones: ZoneMap) -> list[int]:
    limit = np.full(zones.steps, zones.max_hz)
    for zone in zones.zones:
        limit[zone.begin : zone.end] = zone.max_hz
    return [RAMP.index_of(hz) for hz in limit]


@pytest.mark.parametrize("zones", [(), ZONES, (Zone(0, 3, 150.0), Zone(37, 40, 250.0)), (Zone(0, 40, 300.0),)])
def test_the_table_is_that_of_the_specification(zones):
    places = ZoneMap(40, 500.0, zones)
    up, down = StepEnvelope(RAMP, places), StepEnvelope(RAMP, places, -1)
    assert up.indices().tolist() == down.indices().tolist() == reference(caps_of(places), 0, 40)
    assert (up.entries[-1], down.entries[0]) == (SENTINEL, SENTINEL)
    assert up.entries.flags.c_contiguous
    assert down.entries.flags.c_contiguous


def test_the_table_by_departure_position():
    places = ZoneMap(6, 500.0)
    up, down = turn_envelopes(RAMP, places, 1, 5, 2)
    # Beyond its extremes a table can be run as well: down to the start, and from the stop to the end of the travel.
    assert up.entries.tolist() == [1, 0, 1, 1, 0, SENTINEL, SENTINEL]
    assert down.entries.tolist() == [SENTINEL, 0, SENTINEL, 0, 1, 0, 1]
    assert (up.start, up.stop, down.start, down.stop) == (1, 5, 5, 2)


def test_a_zone_cuts_the_frequency_of_its_ramp_index():
    table = StepEnvelope(RAMP, ZoneMap(40, 500.0, ZONES))
    hz = table.permissible_hz()
    assert table.zones.limits == (500.0, 250.0, 150.0, 60.0)
    assert hz[9:21].tolist() == [400, *[250] * 4, *[150] * 6, 300]
    assert hz[30] == 60
    assert hz[29] == hz[31] == 200
    assert table.entries[30] == 3 << INDEX_BITS
    assert table.entries[15] == 2 << INDEX_BITS | 1


def test_limits_of_both_directions_can_share_their_numbers():
    up = ZoneMap(40, 500.0, [Zone(0, 10, 250.0)], also=[150.0])
    down = ZoneMap(40, 500.0, [Zone(5, 10, 150.0)], also=[250.0])
    assert up.limits == down.limits == up.mirrored().limits == (500.0, 250.0, 150.0)


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("stop", [0, 1, 3, 17, 20, 38, 40])
def test_a_moved_extreme_gives_the_table_built_anew(direction, stop):
    places = ZoneMap(40, 500.0, ZONES)
    table = StepEnvelope(RAMP, places, direction)
    for between in (25, 8, stop):
        edit = table.move_stop(between)
        assert (edit.stop, edit.overrun) == (between, False)
        assert edit.written <= 2 * len(RAMP)
        table.move_start(40 - between)
        assert table.start == 40 - between
    anew = StepEnvelope(RAMP, places, direction, 40 - stop, stop)
    assert table.entries.tolist() == anew.entries.tolist()


def test_a_stop_too_near_goes_to_the_nearest_possible_place():
    up, down = turn_envelopes(RAMP, ZoneMap(40, 500.0), 0, 40, 0)
    assert up.move_stop(12, at=10, index=4) == StopEdit(14, overrun=True, written=10)
    assert not up.move_stop(14, at=10, index=4).overrun
    edit = down.move_stop(29, at=30, index=3)
    assert (edit.stop, edit.overrun, down.stop) == (27, True, 27)
    assert up.move_stop(3, at=10, index=-1).stop == 3  # at rest it may lie anywhere
    assert up.move_stop(40, at=39, index=4).stop == 40  # never beyond the travel


def test_memory_of_a_long_ramp_has_no_compact_form():
    long = StepRamp(np.arange(1.0, 257.0))
    found = envelope_memory(long, ZoneMap(1000, 256.0))
    assert (found.tables, found.compact, found.ramp, found.conventional) == (4000, 0, 512, 12)


def test_bad_tables_are_refused():
    with pytest.raises(ValueError, match="18 different limits, must be 16"):
        ZoneMap(40, 500.0, [Zone(k, k + 1, 100.0 + k) for k in range(17)])
    with pytest.raises(ValueError, match="ramp has 2049 entries"):
        StepEnvelope(StepRamp(np.arange(1.0, MAX_RAMP + 2)), ZoneMap(40, 500.0))
    with pytest.raises(ValueError, match=r"position is 41, must be 0\.\.40"):
        StepEnvelope(RAMP, ZoneMap(40, 500.0)).move_stop(41)
