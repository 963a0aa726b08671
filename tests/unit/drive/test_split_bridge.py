import pytest

from detent.drive.split_bridge import SplitBridge, SplitBridgeParams, drive_two, sense_current, side_on

P = SplitBridgeParams(supply=24.0, limit=6.0)


@pytest.mark.parametrize(
    ("current", "over", "under"),
    [(0.0, 0, 0), (5.99, 0, 0), (6.0, 0, 0), (6.01, 1, 0), (-6.0, 0, 0), (-6.01, 0, 1), (100.0, 1, 0)],
)
def test_comparators(current, over, under):
    r = SplitBridge(over=1 - over, under=1 - under)
    sense_current(P, r, current)
    assert (r.over, r.under) == (over, under)


@pytest.mark.parametrize("request_", [-1, 0, 1])
@pytest.mark.parametrize(("over", "under"), [(0, 0), (1, 0), (0, 1)])
def test_the_limit_drops_the_requested_side_only(request_, over, under):
    r = SplitBridge(over=over, under=under)
    blocked = (request_ > 0 and over) or (request_ < 0 and under)
    assert side_on(r, request_) == (0 if blocked else request_)


@pytest.mark.parametrize(
    ("first", "second", "positive", "negative"),
    [
        (1, 1, 24.0, 24.0),
        (-1, -1, -24.0, -24.0),
        (1, -1, 0.0, 0.0),
        (0, 0, -24.0, 24.0),  # the current flows on to the opposite rail
        (1, 0, 0.0, 24.0),
        (0, 1, 0.0, 24.0),
        (-1, 0, -24.0, 0.0),
        (0, -1, -24.0, 0.0),
    ],
)
def test_mean_voltage_of_two_halves_for_either_sign_of_the_current(first, second, positive, negative):
    r = SplitBridge()
    drive_two(P, r, first, second)
    assert (r.positive, r.negative) == (positive, negative)


@pytest.mark.parametrize(
    ("over", "under", "first", "second", "positive", "negative"),
    [
        (1, 0, 1, 1, -24.0, 24.0),  # both sides off: a current above the limit falls
        (1, 0, 1, -1, -24.0, 0.0),
        (0, 1, -1, -1, -24.0, 24.0),
        (0, 1, 1, -1, 0.0, 24.0),
    ],
)
def test_beyond_the_limit_the_current_is_driven_back(over, under, first, second, positive, negative):
    r = SplitBridge(over=over, under=under)
    drive_two(P, r, first, second)
    assert (r.positive, r.negative) == (positive, negative)
