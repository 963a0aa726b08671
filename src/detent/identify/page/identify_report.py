"""The report of an identification: one HTML file that needs nothing else."""

from pathlib import Path

from detent.identify.analyse.frequency_response import FrequencyResponse
from detent.identify.analyse.resonances import Resonances
from detent.identify.fit.identification import Identification
from detent.identify.page.identify_data import identify_report_data
from detent.identify.page.identify_page import identify_page
from detent.page.page import render_page, write_page


def write_identify_report(
    found: Identification,
    path: str | Path,
    title: str | None = None,
    *,
    response: FrequencyResponse | None = None,
    resonances: Resonances | None = None,
) -> None:
    """Write the report of an identification as one self-contained HTML file."""
    write_page(path, identify_page(identify_report_data(found, title, response, resonances)))


def render_identify_report(
    found: Identification,
    title: str | None = None,
    *,
    response: FrequencyResponse | None = None,
    resonances: Resonances | None = None,
) -> str:
    """Make the page as text."""
    return render_page(identify_page(identify_report_data(found, title, response, resonances)))
