"""What gains, forecasts of hunting and tolerances cost: processor time, whatever else the machine does meanwhile.

The bars are those of the tune specification, section 9: where it states the time on two processors, twice that.
"""

import resource
from dataclasses import replace
from statistics import median

import pytest
from tests.acceptance.test_golden_bits import EXAMPLES
from tests.bench.test_commands import call
from tests.standstill_rig import drawn
from tests.store_rig import computed
from tests.tolerance_rig import SHORT, SLIDE, asked, quick

import detent
from detent.methods.cascade.batch import build_many, doubtful, ready
from detent.methods.cascade.loop import LinearLoop
from detent.methods.moves.job import one_move
from detent.tune import workers
from detent.tune.batch import run_chunk
from detent.tune.cases import draw
from detent.tune.stand import look

CASE_BAR = 1.0e-3  # a case of the cascade, 0.5 s simulated [s]: 100 s for 100,000
TICK_BAR = 135e-9  # in its loop
BUILD_BAR = 1.0e-4  # a variant, checks included: 10 s for 100,000
MEMORY_BAR = 500e6  # of 100,000 cases [byte]
DASK_BAR = 0.030  # a chunk of 1000 cases beyond its computation
TUNE_BARS = {"": 8.0, SLIDE: 20.0}
MARGIN_BAR = 0.2e-3  # of a case
HUNT_BARS = 4.0, 20.0  # median, worst
CHECK_BAR = 1.0  # of the row of `detent check`
HELP_BAR = 0.03  # more than that of `detent check`
SERVO_BAR = 12e-3  # a case of the filtered servo: 120 s for 10,000
CASES = 1000


def spent() -> float:
    """Processor time so far of this process and of its children that have ended [s]."""
    own, children = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime


def cost(run) -> float:
    """Processor time of a call [s]."""
    begin = spent()
    run()
    return spent() - begin


def held(benchmark, run, rounds: int = 3) -> float:
    """The least processor time of some calls; the clock of the benchmark beside it is that of the wall."""
    costs = list[float]()
    benchmark.pedantic(lambda: costs.append(cost(run)), rounds=rounds, warmup_rounds=1)
    benchmark.extra_info["processor time [s]"] = min(costs)
    return min(costs)


def test_a_case_of_the_cascade(benchmark, tmp_path):
    question = asked(tmp_path)
    took = held(benchmark, lambda: run_chunk(question, CASES, CASES)) / CASES
    result = run_chunk(question, CASES, 1)
    tick = question.method.tick(question.file.spec)
    benchmark.extra_info["ns per tick"] = 1e9 * took * tick / result.results["time_end"][0]
    if not benchmark.disabled:
        assert took <= CASE_BAR
        assert took <= TICK_BAR * result.results["time_end"][0] / tick


def test_variants_built_as_arrays(benchmark, tmp_path):
    question = asked(tmp_path)
    count = 10 * CASES
    spec, values = ready(question.file.spec), question.variant(draw(question, 0, count))

    def build():
        build_many(spec, values, count)
        doubtful(spec, values, count)

    took = held(benchmark, build) / count
    assert benchmark.disabled or took <= BUILD_BAR


def test_a_case_of_the_filtered_servo(benchmark, tmp_path):
    text = (EXAMPLES / "filtered_servo.toml").read_text(encoding="utf-8")
    table = '[tolerance]\n"mechanics.friction.right.coulomb" = ["0 N", "3 N"]\n'
    question = asked(tmp_path, table, one_move("move", 0.02, 0.3), text)
    took = held(benchmark, lambda: run_chunk(question, 1, 20)) / 20
    assert benchmark.disabled or took <= SERVO_BAR


def test_memory_of_many_cases(benchmark, tmp_path):
    """Of the whole command, with its report; what a job does is not held, so that a short one tells."""
    asked(tmp_path, SLIDE, SHORT, quick())
    job = tmp_path / "short.csv"
    job.write_text("by [mm],dwell [ms]\n0.5,2\n", encoding="utf-8")
    cases = 1000 if benchmark.disabled else 100_000
    words = "-m", "detent", "tolerance", tmp_path / "slide.toml", "--job", job, "--cases", cases, "--report"
    done = benchmark.pedantic(call, args=(*words, tmp_path / "report.html", "--json"), rounds=1)
    benchmark.extra_info["peak MB"] = done.peak / 1e6
    assert done.peak <= MEMORY_BAR


def test_a_chunk_by_dask(benchmark):
    """Scheduler and client in this process, one worker in another; the same chunks computed here do not count."""
    spans = [(first, 1000) for first in range(0, 100_000, 1000)]

    def chunks(number: int) -> float:
        return cost(lambda: list(workers.computed(workers.dask("local:1"), computed, {}, spans[:number])))

    few = chunks(1)
    many = benchmark.pedantic(chunks, args=(len(spans),), rounds=1)
    own = cost(lambda: [computed({}, *span) for span in spans])
    took = (many - few - own) / (len(spans) - 1)
    benchmark.extra_info["ms per chunk"] = 1e3 * took
    assert benchmark.disabled or took <= DASK_BAR


@pytest.mark.parametrize("table", TUNE_BARS, ids=["no tolerance", "tolerances"])
def test_gains(benchmark, tmp_path, table):
    file = tmp_path / "slide.toml"
    file.write_text((EXAMPLES / "cascade.toml").read_text(encoding="utf-8") + table, encoding="utf-8")
    took = held(benchmark, lambda: detent.load(file).tune(), rounds=1)
    assert benchmark.disabled or took <= TUNE_BARS[table]


def test_margins_of_a_case(benchmark, tmp_path):
    """What `--margins` adds to a case, all three cuts, each crossing and peak looked at closer."""
    plain = asked(tmp_path, SLIDE, SHORT, quick())
    with_margins = replace(plain, margins=True)
    took = held(benchmark, lambda: run_chunk(with_margins, CASES, CASES)) - min(
        cost(lambda: run_chunk(plain, CASES, CASES)) for _ in range(3)
    )
    alone = cost(lambda: [LinearLoop(plain.file.spec).margins for _ in range(20)]) / 20
    benchmark.extra_info |= {"ms per case": 1e3 * took / CASES, "ms of one axis alone": 1e3 * alone}
    assert benchmark.disabled or took / CASES <= MARGIN_BAR


def test_forecasts_of_hunting(benchmark):
    """Twelve of the axes of test 21, and number 53, the dearest: it creeps to rest on every one of its starts."""
    axes = [drawn(number) for number in (*range(0, 72, 6), 53)]
    axes[0].hunt()  # compiles
    costs = list[float]()

    def hunt():
        costs[:] = [cost(axis.hunt) for axis in axes]

    benchmark.pedantic(hunt, rounds=1)
    benchmark.extra_info |= {"median [s]": median(costs), "worst [s]": max(costs)}
    if not benchmark.disabled:
        assert median(costs) <= HUNT_BARS[0], costs
        assert max(costs) <= HUNT_BARS[1], costs


def test_the_row_of_check(benchmark):
    file = detent.load(EXAMPLES / "cascade.toml").file
    took = held(benchmark, lambda: look(file))
    if not benchmark.disabled:
        assert took <= CHECK_BAR


def test_help_of_the_verbs(benchmark):
    verbs = "tune", "hunt", "tolerance", "check", ""
    costs = {verb: list[float]() for verb in verbs}

    def help_of_all():
        for verb in verbs:
            costs[verb].append(cost(lambda verb=verb: call("-m", "detent", *filter(None, [verb]), "--help")))

    benchmark.pedantic(help_of_all, rounds=5, warmup_rounds=1)
    benchmark.extra_info |= {f"{verb or 'detent'} --help [s]": median(one) for verb, one in costs.items()}
    if not benchmark.disabled:
        for verb in verbs[:3]:
            assert median(costs[verb]) <= median(costs["check"]) + HELP_BAR
