import re
from dataclasses import replace

import pytest
from tests.page_reader import Reader
from tests.unit.methods.stepper_envelope.samples import MM, tile, tile_plan

from detent.methods.stepper_envelope import stage_plan
from detent.methods.stepper_envelope.stage_plan import TilePlan


def plan_drawing(plan: TilePlan) -> str:
    return plan.drawn("drawing")


def plan_legend(plan: TilePlan) -> str:
    return plan.drawn("legend")


def rects(html: str) -> list[tuple[float, float, float, float]]:
    found = re.findall(r'<rect x="([-\d.]+)" y="([-\d.]+)" width="([-\d.]+)" height="([-\d.]+)"', html)
    return [tuple(float(value) for value in one) for one in found]


def test_tiles_stand_to_scale_as_seen_from_above() -> None:
    one, two, three, four = rects(plan_drawing(tile_plan()))
    across, up = two[0] - one[0], two[1] - three[1]
    assert across / up == pytest.approx(0.4 / 0.3, rel=1e-3)
    assert two[1] == one[1]
    assert three[1] < two[1]  # larger y stands higher
    assert (four[0], four[1]) == (one[0], three[1])
    # As wide and as high as the tiles are apart, but for a gap.
    assert one[2:] == (pytest.approx(0.86 * across, abs=0.1), pytest.approx(0.86 * up, abs=0.1))
    assert all(x > 0 and x + width < stage_plan.WIDTH for x, _, width, _ in (one, two, three, four))


def test_the_path_goes_through_the_places_in_their_order() -> None:
    plan = tile_plan()
    moved = replace(plan.tiles[1], place=(5.6 * MM, 7 * MM), off=True)
    html = plan_drawing(tile_plan(tiles=[plan.tiles[0], moved, *plan.tiles[2:]]))
    (points,) = re.findall(r'<polyline points="([^"]+)"', html)
    xs = [float(point.split(",")[0]) for point in points.split()]
    squares = rects(html)
    centres = [x + width / 2 for x, _, width, _ in squares]
    assert len(xs) == 5  # from where it stood first
    assert xs[1] == pytest.approx(centres[0], abs=0.1)
    # The rotor stood half a pitch beside the tile.
    assert xs[2] - centres[1] == pytest.approx(0.5 * (centres[1] - centres[0]), abs=0.2)
    assert html.count("var(--bad)") == 1


def test_a_tile_that_took_long_is_strong_and_the_others_pale() -> None:
    opacities = [
        float(one) for one in re.findall(r"fill:var\(--speed\);fill-opacity:([\d.]+)", plan_drawing(tile_plan()))
    ]
    assert opacities == [0.85, 0.12, 0.12, 0.12]
    legend = Reader(plan_legend(tile_plan())).text
    assert "100 ms, the median, or less" in legend
    assert "200 ms or more" in legend
    assert "beside its place" not in legend
    off = tile_plan(tiles=[replace(one, off=True) for one in tile_plan().tiles])
    assert "a rotor stood beside its place" in Reader(plan_legend(off)).text


def test_names_and_scale_are_written() -> None:
    page = Reader(plan_drawing(tile_plan()))
    assert page.open == []
    assert [word for word in page.words if word.isdigit()] == ["11", "12", "13", "14"]
    assert "0.2 mm" in page.words
    assert "x →" in page.words
    assert "↑ y" in page.words
    assert "tile 11: 400 ms, lag up to 1.02 steps" in page.text.replace("\u202f", " ")


def test_tiles_too_small_for_a_name_have_none() -> None:
    tiles = [tile(n, n * 0.1 * MM, 0.0) for n in range(1, 61)]
    page = Reader(plan_drawing(tile_plan(tiles=tiles)))
    assert not any(word.isdigit() for word in page.words)
    assert len(rects(plan_drawing(tile_plan(tiles=tiles)))) == 60


def test_a_single_row_and_a_single_tile_are_squares() -> None:
    row = rects(plan_drawing(tile_plan(tiles=[tile(1, 0.0, 0.0), tile(2, 1 * MM, 0.0)])))
    assert row[0][2] == row[0][3]
    ((_, _, width, height),) = rects(plan_drawing(tile_plan(tiles=[tile(1, 0.0, 0.0)])))
    assert width == height > 100
    column = rects(plan_drawing(tile_plan(tiles=[tile(1, 0.0, 0.0), tile(2, 0.0, 2 * MM)])))
    assert column[0][2] == column[0][3]


def test_only_so_many_tiles_are_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stage_plan, "MOST_TILES", 3)
    assert len(rects(plan_drawing(tile_plan()))) == 3


def test_what_names_say_cannot_break_the_drawing() -> None:
    evil = tile_plan(motors=("<x>", "&y"), tiles=[tile(1, 0.0, 0.0, label="<b>")])
    page = Reader(plan_drawing(evil))
    assert page.open == []
    assert {"<x> →", "↑ &y", "<b>"} <= set(page.words)
