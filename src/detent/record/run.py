"""What every run notes, whichever axis made it."""

from dataclasses import dataclass, field
from typing import Any, ClassVar, Generic, TypeVar

JobT = TypeVar("JobT")


@dataclass
class RunRecord(Generic[JobT]):
    """Outcome of a job; each method adds what its runs have beside. Times since power-on [s]."""

    job: JobT  # what was asked; it has a name and a kind
    done: bool = False  # the axis did the whole job
    failure: str = ""  # why not, and what to do; empty if `done`
    warnings: list[str] = field(default_factory=list[str])  # what a user should know though it was done
    time_ready: float = 0.0  # the axis takes commands, and the job begins
    time_end: float = 0.0

    told: ClassVar[tuple[str, ...]] = ()
    """Names of the figures that `to_dict` gives beside these."""

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``."""
        job: Any = self.job
        names = ("done", "failure", "warnings", "time_ready", "time_end", *self.told)
        return {"job": job.name, "kind": job.kind} | {name: getattr(self, name) for name in names}
