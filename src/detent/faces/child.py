"""The faces of a live axis as children of the process that runs it: a process each, started again where it has died."""

import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from detent.errors import AxisError


class Face(NamedTuple):
    """A protocol: the module that speaks it, what pip calls it, and what its clients are told before a place."""

    module: str
    extra: str
    title: str


FACES = {
    "epics": Face("epics", "epics", "EPICS motor record (Channel Access)"),
    "pva": Face("pva", "pva", "EPICS motor record (PV Access)"),
    "canopen": Face("node402", "can", "CiA 402 drive"),
    "modbus": Face("modbus", "modbus", "Modbus TCP"),
    "scpi": Face("scpi", "", "SCPI lines"),
    "grbl": Face("grbl", "", "grbl 1.1"),
    "gcs": Face("gcs", "", "PI GCS 2.0"),
    "zaber": Face("zaber", "", "Zaber ASCII, native units"),
    "alpaca": Face("alpaca", "", "ASCOM Alpaca"),
}


class Faces:
    """The processes of the faces that were asked for, each with its address; `channels` by motor, "" a single one."""

    def __init__(self, channels: Mapping[str, Path], wanted: Mapping[str, str], *, commands: bool) -> None:
        self._channels, self._commands = {motor: str(channel) for motor, channel in channels.items()}, commands
        self._processes: dict[str, Any] = {}
        self._addresses = dict(wanted)
        self.places: dict[str, Sequence[str]] = {}
        try:
            for face in wanted:
                self._start(face)
        except BaseException:
            self.close()
            raise

    def _start(self, face: str) -> None:
        told = {
            "face": face, "channels": self._channels, "address": self._addresses[face], "commands": self._commands,
        }  # fmt: skip
        # A group of its own: Ctrl-C at the terminal must not close it before the axis is at rest.
        process = subprocess.Popen(
            [sys.executable, "-m", "detent.faces"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            process_group=0,
        )  # fmt: skip
        self._processes[face] = process
        assert process.stdin is not None  # noqa: S101 - it is a pipe
        assert process.stdout is not None  # noqa: S101 - it is a pipe
        with suppress(BrokenPipeError):  # it has ended: no answer tells so
            process.stdin.write(json.dumps(told) + "\n")
            process.stdin.flush()
        answer: dict[str, Any] = json.loads(process.stdout.readline() or "{}")
        if "places" not in answer:
            why = answer.get("error", "its process ended")
            raise AxisError(
                f"--{face}: the face did not start ({why}); mend that, choose another place, or do without it"
            )
        self.places[face] = answer["places"]
        listens = [place for place in answer["places"] if "::" not in place and place.rpartition(":")[2].isdigit()]
        if listens and self._addresses[face].endswith(":0"):
            self._addresses[face] = listens[0]  # clients find it there again

    def mend(self) -> list[str]:
        """Start again what has died; tells what has happened."""
        told: list[str] = []
        for face, process in [*self._processes.items()]:
            if process.poll() is None:
                continue
            self._end(face)
            try:
                self._start(face)
                told.append(f"The {face} face had ended, and runs again: {', '.join(self.places[face])}")
            except AxisError as error:  # the axis goes on without it
                self._end(face)
                told.append(f"The {face} face has ended: {error}")
        return told

    @property
    def processes(self) -> dict[str, int]:
        """Number of each process."""
        return {face: process.pid for face, process in self._processes.items()}

    def _end(self, face: str) -> None:
        process = self._processes.pop(face)
        with suppress(BrokenPipeError):
            process.stdin.close()
        try:
            process.wait(3.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        process.stdout.close()

    def close(self) -> None:
        """End them."""
        for face in [*self._processes]:
            self._end(face)
