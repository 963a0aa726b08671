"""What the course of a live axis costs: a sample, and a plan when something else is commanded."""

import ruckig
from tests.bench.race import Race, timed
from tests.course_rig import at_rest, limits

from detent.kernel.step import step
from detent.planning import course
from detent.planning.course import advance, come_to_rest, go_to, run_at

SAMPLES, PLANS = 200_000, 2000

SAMPLE_BAR = 5.0
"""A sample in steady motion may take this many times as long as working out its three polynomials alone."""

PLAN_BAR = 30.0
"""A plan that looks for the moment of its stop may take this many times as long as ruckig's of the same move."""


@step
def polynomials(c, period, samples):
    """Position, velocity and acceleration of a stretch of constant jerk; added up, so that none is left out."""
    v, a, j = c.v[0], c.a[0], c.j[0]
    for k in range(samples):
        t = k * period
        c.position += c.x[0] + t * (v + t * (a / 2.0 + t * j / 6.0))
        c.velocity += v + t * (a + t * j / 2.0)
        c.acceleration += a + t * j


@step
def follow(p, c, period, samples):
    for _ in range(samples):
        advance(p, c, period)


@step
def plan_moves(p, c, near, far, plans):
    for k in range(plans):
        go_to(p, c, far if k & 1 else near)


@step
def plan_stops(p, c, plans):
    for _ in range(plans):
        c.mode = course.RUN
        come_to_rest(p, c)


def sampled(run):
    def samples():
        run()
        return SAMPLES

    return timed(samples)


def planned(run):
    def plans():
        run()
        return PLANS

    return timed(plans)


def by_ruckig():
    """The same short move from the same state, and its calculation alone."""
    asked, found, planner = ruckig.InputParameter(1), ruckig.Trajectory(1), ruckig.Ruckig(1)
    _, c = jogging()
    asked.current_position, asked.current_velocity = [c.position], [c.velocity]
    asked.current_acceleration, asked.target_position = [c.acceleration], [c.position + 0.025]
    asked.max_velocity, asked.max_acceleration, asked.max_jerk = [1.0], [10.0], [200.0]

    def plans():
        for _ in range(PLANS):
            planner.calculate(asked, found)

    return plans


def jogging():
    """A jog that still speeds up."""
    p, c = limits(course, 1.0, 10.0, 200.0), at_rest(course)
    run_at(p, c, 0.5)
    follow(p, c, 1e-3, 20)
    return p, c


def test_a_sample_and_a_plan(benchmark):
    p, running = jogging()
    follow(p, running, 1e-3, 1000)
    _, moving = jogging()
    near, far = moving.position + 0.02, moving.position + 0.03
    race = Race({
        "sample of a jog": sampled(lambda: follow(p, running, 1e-3, SAMPLES)),
        "sample at rest": sampled(lambda: follow(p, at_rest(course), 1e-3, SAMPLES)),
        "polynomials alone": sampled(lambda: polynomials(running.copy(), 1e-3, SAMPLES)),
        "plan of a short move": planned(lambda: plan_moves(p, moving, near, far, PLANS)),
        "plan of a long move": planned(lambda: plan_moves(p, moving, 1.0, 2.0, PLANS)),
        "plan of a stop": planned(lambda: plan_stops(p, moving, PLANS)),
        "ruckig's short move": planned(by_ruckig()),
    })  # fmt: skip
    if race.hold(benchmark, "sample of a jog", 25):
        assert race.ratio("sample of a jog", ["polynomials alone"]) <= SAMPLE_BAR, race.nanoseconds()
        assert race.ratio("plan of a short move", ["ruckig's short move"]) <= PLAN_BAR, race.nanoseconds()
        assert race.ratio("sample at rest", ["sample of a jog"]) < 1.0, race.nanoseconds()
