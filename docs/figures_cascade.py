"""The figures of the cascade axis: each is drawn from runs of the simulation."""

from typing import Any

import numpy as np
from figures import BLUE, FOLDER, GREEN, GREY, ORANGE, picture

LEGEND = {"loc": "lower left", "bbox_to_anchor": (0, 1), "fontsize": 9}


def slide(*overrides: str) -> Any:
    """The example axis."""
    import detent

    return detent.load(detent.example("cascade.toml"), overrides)


def one_move(axis: Any, target: float, *, dwell: float = 0.0, signals: tuple[str, ...] = ()) -> Any:
    """A move of the example to a place [m], with a row per sample."""
    from detent.methods.moves.job import Move, MoveJob

    names = signals or (
        "controller.reference.position",
        "plant.machine.load.position",
        "controller.law.position_error",
        "controller.law.command",
    )
    return axis.run(MoveJob("move", "moves", (Move(1, 0, target=target, dwell=dwell),)), signals=names)


def feed_forward() -> None:
    """Following error of one move with more and more feedforward."""
    shares: tuple[tuple[str, tuple[str, ...]], ...] = (
        ("none", ("velocity", "acceleration", "viscous", "coulomb")),
        ("velocity", ("acceleration", "viscous", "coulomb")),
        ("velocity, acceleration", ("viscous", "coulomb")),
        ("all of it", ()),
    )
    with picture("feedforward.png", 2, 4.6) as (coarse, fine):
        for (name, off), colour in zip(shares, (GREY, ORANGE, GREEN, BLUE), strict=True):
            run = one_move(slide(*(f"method.feed_forward.{key}=0" for key in off)), 0.27)
            part = run.trace.between(run.result.moves[0].begin, run.result.moves[0].end)
            t, error = 1e3 * (part.time - part.time[0]), part["controller.law.position_error"]
            coarse.plot(t, 1e3 * error, color=colour, linewidth=1.5, label=name)
            fine.plot(t, 1e6 * error, color=colour, linewidth=1.2)
        coarse.set_ylabel("following error\n[mm]")
        coarse.legend(**LEGEND, ncols=4)
        fine.set_ylim(-220, 220)
        fine.set_ylabel("the same,\nmagnified [µm]")
        fine.set_xlabel("time since the move began [ms]")


def profiles() -> None:
    """A move in four variants, as `detent compare` draws it."""
    from detent.page.draw import draw_figures

    # Its table stands in the text, as the terminal prints it.
    drawn = [figure for figure in slide().compare()[0].figures() if figure.charts]
    draw_figures(drawn, FOLDER / "profiles.png")


def which_encoder() -> None:
    """Load and motor at the end of a move across backlash, with the position loop on either encoder."""
    import detent

    with picture("which-encoder.png", 2, 4.4) as areas:
        for area, where in zip(areas, ("motor", "load"), strict=True):
            axis = detent.load(
                detent.example("turntable.toml"),
                [f'method.feedback.position="{where}"', "mechanics.coupling.backlash=0.1 deg",
                 "method.in_position=0.2 deg", "disturbance.push.force=-0.4 N*m", "disturbance.push.at=0 s",
                 "disturbance.push.duration=60 s"],
            )  # fmt: skip
            signals = ("controller.reference.position", "plant.machine.motor.position", "plant.machine.load.position")
            run = one_move(axis, np.radians(45), dwell=0.6, signals=signals)
            begin = run.result.moves[0].arrived - 0.25
            part = run.trace.between(begin, run.result.moves[0].end)
            t = part.time - run.result.moves[0].arrived
            for name, colour, text in (("motor", GREY, "motor"), ("load", BLUE, "table")):
                off = np.degrees(part[f"plant.machine.{name}.position"]) - 45
                area.plot(1e3 * t, off, color=colour, linewidth=1.6, label=text)
            area.axhline(0, color="black", linewidth=0.8)
            area.set_ylim(-0.3, 0.3)
            area.set_ylabel("off the target\n[deg]")
            area.set_title(f"position loop on the encoder of the {where}", fontsize=9, loc="right")
        areas[0].legend(**LEGEND, ncols=2)
        areas[-1].set_xlabel("time since the reference ended [ms]")


def _written(page: str, name: str) -> str:
    """A file that a page of the instructions shows."""
    from pathlib import Path

    text = (Path(__file__).parent / "how-to" / page).read_text(encoding="utf-8")
    return text.partition(f"<!-- file: {name} -->\n```toml\n")[2].partition("```")[0]


def tuned() -> None:
    """The loop and a push before and after `detent tune`, as its report draws them: of the page "Tune my axis"."""
    import detent
    from detent.page.draw import draw_figures
    from detent.tune.page import tuned_page

    by_ear = ["method.position_gain=40", "method.velocity_gain=100 V*s/m", "method.velocity_integral=5 kV/m"]
    page = tuned_page(detent.load(detent.example("cascade.toml"), by_ear).tune())
    draw_figures([one for one in page.figures if one.title in {"Cut at the command", "Push of 200 N"}],
                 FOLDER / "tuned.png")  # fmt: skip


def hunted() -> None:
    """How the axis of the page "Will it hunt?" goes to and fro, and why, as the report of `detent hunt` draws it."""
    import tempfile
    from pathlib import Path

    import detent
    from detent.page.draw import draw_figures
    from detent.tune.hunt_page import hunted_page

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "dry.toml")
        file.write_text(_written("will-it-hunt.md", file.name), encoding="utf-8")
        page = hunted_page(detent.load(file).hunt())
    draw_figures([one for one in page.figures if one.title in {"The worst start", "From slip to slip"}],
                 FOLDER / "hunted.png")  # fmt: skip


def tolerance() -> None:
    """How a quantity of many machines spreads, and which of them fail, as the report of `detent tolerance` draws it."""
    import tempfile
    from pathlib import Path

    import detent
    from detent.page.draw import draw_figures
    from detent.tune.tolerance_page import tolerance_page

    # The file of the page "How many of a hundred machines will be good?".
    entries = _written("how-many-are-good.md", "tolerance.toml")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "slide.toml")
        file.write_text(
            Path(detent.example("cascade.toml")).read_text(encoding="utf-8") + "\n" + entries, encoding="utf-8"
        )
        file.with_name("there.toml").write_text('[[move]]\ntarget = "150 mm"\n')
        asked = detent.load(file)
        found = asked.tolerance(file.with_name("there.toml"), cases=400, limits=["peak_command <= 2.35 V"])
    drawn = [one for one in tolerance_page(found).figures if one.title in {"peak_command", "Where the bad ones lie"}]
    draw_figures(drawn[::-1], FOLDER / "tolerance.png")


FIGURES = (feed_forward, profiles, which_encoder, tuned, hunted, tolerance)
