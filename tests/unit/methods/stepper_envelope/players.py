"""Real runs of the example stages, and curves of their pages."""

import math
from pathlib import Path

import numpy as np

import detent
from detent.methods.load import load_spec
from detent.methods.stepper_envelope.build import instant
from detent.methods.stepper_envelope.host import stage_registers
from detent.methods.stepper_envelope.run import StageRun, run_stage, stage_signals
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec
from detent.methods.stepper_envelope.stage_job import StageJob, StageJog, StageMove
from detent.page.frame import Page
from detent.record.recorder import Recorder
from detent.record.trace import Trace

MM = 1e-3
Played = tuple[StepperEnvelopeSpec, StageRun, Trace]


def play(example: str | Path, job: StageJob, *overrides: str, every: int = 50) -> Played:
    spec = load_spec(detent.example(example) if isinstance(example, str) else example, overrides)
    assert isinstance(spec, StepperEnvelopeSpec)
    recorder = Recorder(stage_registers(spec), stage_signals(spec), every=every, period=instant(spec))
    return spec, run_stage(spec, job, recorder=recorder), recorder.trace()


def moves(*made: StageMove | StageJog) -> StageJob:
    return StageJob("moves.toml", "moves", made, ("group_a", "group_b"), ("read so",))


def chart_of(page: Page, name: str) -> dict:
    return next(chart for chart in page.charts if chart["id"] == name)


def curve_of(page: Page, chart: str, label: str) -> np.ndarray:
    (found,) = [series["y"] for series in chart_of(page, chart)["series"] if series["label"] == label]
    return np.array([math.nan if value is None else value for value in found])
