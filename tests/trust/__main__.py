"""Run the full trust test and write its page: python -m tests.trust, from the root of the project, takes minutes."""

import argparse
import sys
from pathlib import Path

from tests.trust.judge import judge_all, numbers_of
from tests.trust.table import figures_of, page, sections
from tests.trust.test_trust import BAD_LOGS, GOOD_LOGS

PAGE = Path(__file__).parents[2] / "docs" / "explanation" / "trust-table.md"


def main() -> None:
    """Judge all cases twice, with and without their references."""
    parser = argparse.ArgumentParser(prog="python -m tests.trust", description=__doc__)
    parser.add_argument("--good", type=int, default=GOOD_LOGS, help=f"good logs ({GOOD_LOGS})")
    parser.add_argument("--bad", type=int, default=BAD_LOGS, help=f"bad logs ({BAD_LOGS})")
    parser.add_argument("--first", type=int, default=0, help="number of the first case (0)")
    parser.add_argument("--workers", type=int, help="processes (one per processor)")
    parser.add_argument("--output", type=Path, default=PAGE, help="where the page is written")
    asked = parser.parse_args()
    numbers = numbers_of(asked.good, asked.bad, asked.first)
    with_reference, without = (
        figures_of(judge_all(numbers, with_reference=has, workers=asked.workers)) for has in (True, False)
    )
    for title, figures in (("with the reference", with_reference), ("without the reference", without)):
        sys.stdout.write(f"-- {title}\n{sections(figures)}\n")
        for j in (*figures.refused_good, *figures.accepted_bad):
            sys.stdout.write(f"case {j.number} {j.bad or 'good'}: {j.verdict}: {'; '.join(j.subjects)}\n")
    asked.output.write_text(page(with_reference, without, asked.first), encoding="utf-8")


if __name__ == "__main__":
    main()
