"""What `detent check` shows: a look at the values, and where the method's starts cost little, one at standstill."""

from dataclasses import replace

from detent.methods.check import CheckReport, check_spec
from detent.methods.load import AxisFile
from detent.methods.registry import METHODS


def check_axis(file: AxisFile) -> CheckReport:
    """Look an axis over, at standstill too where its method says so; what that takes loads only then."""
    report = check_spec(file)
    if not METHODS[file.spec.axis.method].checks_standstill:
        return report
    from detent.tune.stand import look

    row, cautions = look(file)
    return replace(report, derived=(*report.derived, row), warnings=(*report.warnings, *cautions))
