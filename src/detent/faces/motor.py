"""The motor record of EPICS on an axis: its live fields, and what a put to each of them does, whatever carries it.

User and dial coordinates are those of the record: user = DIR * dial + OFF; the axis has the dial. Raw values are
counts. A field that is not among those here has its default, and nothing reads it.
"""

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from typing import Any

from detent.errors import DetentError
from detent.faces.service import AxisService, NotDoneError, address_of

STOP, PAUSE, MOVE, GO = range(4)  # of SPMG
MAJOR, STATE_ALARM = 2, 7  # severity and status of a fault
POSITIVE, AT_PLUS, AT_POSITION, SLIP, HAS_ENCODER, PROBLEM, MOVING, AT_MINUS, HOMED, DONE = (
    1 << bit for bit in (0, 2, 5, 6, 8, 9, 10, 13, 14, 1)
)  # of MSTA
MOTIONS = "VAL", "DVAL", "RVAL", "RLV", "TWF", "TWR", "JOGF", "JOGR", "HOMF", "HOMR"  # fields that begin one
COUNTS = 1000  # of a revolution, as the record counts them: the axis does not say how many its motor makes
Show = Callable[[Mapping[str, Any]], Awaitable[None]]


class Motor:
    """A record; `show` tells its clients which fields have changed."""

    def __init__(self, axis: AxisService, show: Show) -> None:
        self.axis, self._show = axis, show
        low, high = axis.limits or (0.0, 0.0)
        rate = axis.about["acceleration"]
        self._rate: float = rate * axis.scale if rate else 0.0  # acceleration of the axis; 0 where it does not say
        self.fields: dict[str, Any] = {
            "VAL": axis.commanded, "RLV": 0.0, "TWV": 1.0, "TWF": 0, "TWR": 0, "JOGF": 0, "JOGR": 0, "HOMF": 0,
            "HOMR": 0, "STOP": 0, "SPMG": GO, "DMOV": 1, "MOVN": 0, "MIP": 0, "SET": 0, "FOFF": 0, "OFF": 0.0, "DIR": 0,
            "VELO": axis.speed, "VMAX": axis.speed, "VBAS": 0.0, "JVEL": axis.speed / 4, "HVEL": axis.speed / 10,
            "DHLM": high, "DLLM": low, "HLM": high, "LLM": low, "LVIO": 0, "MRES": axis.count, "ERES": axis.count,
            "EGU": axis.unit, "PREC": 4, "CNEN": 0, "RDBD": axis.count, "LSPG": GO,
            "SREV": COUNTS, "UREV": COUNTS * axis.count, "OUT": "@detent", "DESC": axis.about["name"][:40],
        }  # fmt: skip
        self._moves = 0  # motions that clients wait for
        self._ends = (low, high)
        self._jogs = False
        self.severity = self.status = 0
        self.fields |= self._seen() | self._coordinates()
        self._stops = self._stopping = 0  # stops that have come, and that are under way
        self._free = asyncio.Event()
        self._free.set()
        self._fresh = asyncio.Event()
        axis.subscribe(self._fresh.set)
        self.actions: dict[str, Callable[[Any], Awaitable[None]]] = {
            "VAL": self._go, "DVAL": lambda v: self._go(self.user(v)),
            "RVAL": lambda v: self._go(self.user(self.axis.from_counts(v))), "RLV": self._by,
            "TWF": lambda v: self._tweak("TWF", v), "TWR": lambda v: self._tweak("TWR", v),
            "JOGF": lambda v: self._jog("JOGF", v), "JOGR": lambda v: self._jog("JOGR", v),
            "HOMF": lambda v: self._home("HOMF", v), "HOMR": lambda v: self._home("HOMR", v), "STOP": self._stop,
            "SPMG": self._mode, "CNEN": self._enable, "HLM": lambda v: self._limit("HLM", v),
            "LLM": lambda v: self._limit("LLM", v), "DHLM": lambda v: self._limit("DHLM", v),
            "DLLM": lambda v: self._limit("DLLM", v), "OFF": lambda v: self._calibrate(OFF=v),
            "DIR": lambda v: self._calibrate(DIR=v), "VELO": lambda v: self._speed("VELO", v),
            "JVEL": lambda v: self._speed("JVEL", v), "TWV": lambda v: self._keep("TWV", v),
            "SET": lambda v: self._keep("SET", v), "FOFF": lambda v: self._keep("FOFF", v),
            "PREC": lambda v: self._keep("PREC", v), "SSET": lambda _: self._keep("SET", 1),
            "SUSE": lambda _: self._keep("SET", 0), "SYNC": lambda _: self._synchronise(),
        }  # fmt: skip
        for fixed in ("VMAX", "VBAS", "ACCL", "MRES", "ERES", "EGU", "HVEL"):  # the axis file's: a put changes nothing
            self.actions[fixed] = lambda _, name=fixed: self._keep(name, self.fields[name])

    # ---- coordinates

    @property
    def _sign(self) -> int:
        return -1 if self.fields["DIR"] else 1

    def user(self, dial: float) -> float:
        """User coordinate of a dial."""
        return self._sign * dial + self.fields["OFF"]

    def dial(self, user: float) -> float:
        """Dial of a user coordinate."""
        return self._sign * (user - self.fields["OFF"])

    def _coordinates(self) -> dict[str, Any]:
        """What follows from the set-point and the calibration."""
        f = self.fields
        low, high = sorted((self.user(f["DLLM"]), self.user(f["DHLM"])))
        seconds = f["VELO"] / self._rate if self._rate else 0.2
        dial = self.dial(f["VAL"])
        return {"DVAL": dial, "RVAL": self.axis.to_counts(dial), "LLM": low, "HLM": high, "ACCL": seconds}

    def _seen(self) -> dict[str, Any]:
        """What follows from the newest sample."""
        axis, f = self.axis, self.fields
        dial = axis.position
        moving = axis.moving
        at = {"upper": "HLS", "lower": "LLS"}.get(axis.at_end, "")
        if f["DIR"] and at:
            at = "LLS" if at == "HLS" else "HLS"
        forward = axis.velocity * self._sign > 0 if moving else bool(f.get("TDIR", 0))
        status = (
            POSITIVE * forward | DONE * (not moving) | AT_PLUS * (at == "HLS") | AT_MINUS * (at == "LLS")
            | HAS_ENCODER | AT_POSITION * axis.enabled | SLIP * (axis.fault in (10, 12)) | PROBLEM * bool(axis.fault)
            | MOVING * moving | HOMED * axis.homed
        )  # fmt: skip
        return {
            "RBV": self.user(dial), "DRBV": dial, "RRBV": axis.counts, "REP": axis.counts, "RMP": axis.counts,
            "MOVN": int(moving), "HLS": int(at == "HLS"), "LLS": int(at == "LLS"), "TDIR": int(forward), "MSTA": status,
            "CNEN": int(axis.enabled), "DIFF": self.dial(f["VAL"]) - dial, "ATHM": 0,
            "RDIF": axis.to_counts(self.dial(f["VAL"])) - axis.counts,
        }  # fmt: skip

    async def follow(self) -> None:
        """Show every sample, as far as it has changed something."""
        while not self.axis.gone.is_set():
            await self._fresh.wait()
            self._fresh.clear()
            await self.show_sample()

    async def show_sample(self) -> None:
        """The newest sample; a motion that nobody waits for, as from the panel, is shown as one."""
        seen = self._seen()
        if not self._moves:
            stands = self._stopping and self.fields["DMOV"]  # a stop of what stands is no motion: no pulse
            seen |= {"DMOV": int(bool(stands) or not self.axis.moving), "MIP": 0}
            if self.axis.moving and not self._jogs:  # somebody else moves it: the set-point follows, as it does in SYNC
                seen |= {"VAL": self.user(self.axis.commanded)}
        self.severity, self.status = (MAJOR, STATE_ALARM) if self.axis.fault else (0, 0)
        await self.change(seen)

    async def change(self, fields: Mapping[str, Any]) -> None:
        """Keep values, and show those that are new."""
        new = {name: value for name, value in fields.items() if self.fields.get(name) != value}
        self.fields |= new
        if new.keys() & {"VAL", "OFF", "DIR", "DLLM", "DHLM", "VELO"}:
            more = {name: value for name, value in self._coordinates().items() if self.fields.get(name) != value}
            self.fields |= more
            new |= more
        if new:
            await self._show(new)

    # ---- puts

    async def put(self, field: str, value: Any) -> None:
        """A client's put; it is complete when what it has begun is done. What is refused is an error."""
        if field not in self.actions:
            return
        stops = self._stops
        if field != "STOP":
            await self._free.wait()  # a put behind a stop comes behind its end, which would cut what it begins
            if field in MOTIONS and stops != self._stops:
                await self.change({"DMOV": 0})  # another stop has come meanwhile: a motion that ended at once, so that
                await self.change({"DMOV": 1})  # nobody waits for it
                return
        await self.actions[field](value)

    async def _keep(self, field: str, value: Any) -> None:
        await self.change({field: value})

    async def _go(self, user: float) -> None:
        """A set-point: a move, or in SET mode another name for where it is."""
        if self.fields["SET"]:
            await self._rename(user)
            return
        if self.fields["SPMG"] in (STOP, PAUSE):
            await self.change({"VAL": user})
            return
        low, high = self.fields["LLM"], self.fields["HLM"]
        if self.axis.limits and low < high and not low <= user <= high:
            await self.change({"LVIO": 1})
            raise NotDoneError("move_to", "refused", 31, f"beyond the limits, {low:g} to {high:g} {self.axis.unit}")
        await self.change({"VAL": user, "LVIO": 0})
        await self._motion(self.axis.move_to(self.dial(user), self.fields["VELO"]))
        if self.fields["SPMG"] == MOVE:
            await self.change({"SPMG": PAUSE, "LSPG": MOVE})

    async def _rename(self, user: float) -> None:
        """Calibrate: the axis itself cannot be told another position, so that the offset is what moves."""
        await self.change({"OFF": user - self._sign * self.axis.position, "VAL": user})
        await self.change(self._seen())

    async def _motion(self, motion: Awaitable[None]) -> None:
        """Lead a motion to its end: DMOV is 0 meanwhile, and 1 only behind the read-back of its end."""
        self._moves, stops = self._moves + 1, self._stops
        await self.change({"DMOV": 0, "MOVN": 1, "MIP": 0x20})
        try:
            await self.axis.enable()
            if stops == self._stops:  # nobody has stopped it before it could begin
                await motion
        except NotDoneError as error:
            if error.how != "aborted":  # a stop, or another set-point, has taken its place
                await self.change({"VAL": self.user(self.axis.commanded)})
                raise
        finally:
            if asyncio.iscoroutine(motion):
                motion.close()
            self._moves -= 1
            await self.axis.refresh()
            await self.change(self._seen())
            if not self._moves:
                await self.change({"DMOV": 1, "MOVN": 0, "MIP": 0})
                await self.axis.give_back()

    async def _by(self, way: float) -> None:
        await self.change({"RLV": 0.0})
        await self._go(self.fields["VAL"] + way)

    async def _tweak(self, field: str, value: int) -> None:
        if value:
            await self.change({field: 0})
            await self._go(self.fields["VAL"] + self.fields["TWV"] * (1 if field == "TWF" else -1))

    async def _home(self, field: str, value: int) -> None:
        if value:
            await self.change({field: 1})
            try:
                await self._motion(self.axis.do("home"))
                await self.change({"VAL": self.user(self.axis.commanded)})
            finally:
                await self.change({field: 0})

    async def _jog(self, field: str, value: int) -> None:
        """A jog lives for as long as it is put again, five times a second at least; 0 stops it."""
        if not value:
            if self._jogs:
                await self._stop(1)
            return
        if self._jogs:
            await self.axis.hold()
            return
        velocity = self.fields["JVEL"] * (1 if field == "JOGF" else -1) * self._sign
        await self.axis.enable()
        await self.axis.jog(velocity)
        self._jogs = True
        await self.change({field: 1, "DMOV": 0, "MOVN": 1})
        self._jogging = asyncio.ensure_future(self._jog_ends(field))

    async def _jog_ends(self, field: str) -> None:
        while self.axis.moving and not self.axis.gone.is_set():  # noqa: ASYNC110 - either of two
            await asyncio.sleep(0.02)
        self._jogs = False
        await self.axis.give_back()
        await self.change({"VAL": self.user(self.axis.commanded), field: 0})
        await self.show_sample()

    async def _halt(self) -> None:
        """Come to rest; puts that arrive meanwhile wait for that."""
        self._stops += 1
        self._stopping += 1
        self._free.clear()
        try:
            await self.axis.stop()
        finally:
            self._jogs = False
            self._stopping -= 1

    def _go_on(self) -> None:
        """What waits behind the last stop may begin."""
        if not self._stopping:
            self._free.set()

    async def _stop(self, value: int) -> None:
        """Stop, and be ready for the next time: also when it stood."""
        if value:
            try:
                await self._halt()
            finally:
                await self.change({"STOP": 0, "JOGF": 0, "JOGR": 0, "VAL": self.user(self.axis.commanded)})
                self._go_on()

    async def _mode(self, value: int) -> None:
        before, target = self.fields["SPMG"], self.fields["VAL"]
        await self.change({"SPMG": value, "LSPG": before})
        if value in (STOP, PAUSE) and self.axis.moving:
            try:
                await self._halt()
                await self.change({"VAL": target if value == PAUSE else self.user(self.axis.commanded)})
            finally:
                self._go_on()
        elif value in (MOVE, GO) and before == PAUSE:
            await self._go(target)

    async def _enable(self, value: int) -> None:
        try:
            await (self.axis.enable() if value else self.axis.do("disable"))
        finally:
            await self.change({"CNEN": int(self.axis.enabled)})
            await self.axis.give_back()

    async def _limit(self, field: str, value: float) -> None:
        """Soft limits of the record, within those of the axis."""
        dial = field if field in ("DHLM", "DLLM") else None
        if dial is None:
            upper = (field == "HLM") == (self._sign > 0)
            dial, value = ("DHLM" if upper else "DLLM"), self.dial(value)
        low, high = self._ends
        await self.change({dial: min(max(value, low), high) if self.axis.limits else value})

    async def _calibrate(self, **what: Any) -> None:
        dial = self.dial(self.fields["VAL"])
        self.fields |= what
        await self._show(what)
        await self.change({"VAL": self.user(dial)} | self._coordinates() | self._seen())

    async def _speed(self, field: str, value: float) -> None:
        if not value > 0.0:
            raise DetentError(f"{field}: got {value:g}; expected: above 0 to {self.axis.speed:g} {self.axis.unit}/s")
        await self.change({field: min(value, self.axis.speed)})

    async def _synchronise(self) -> None:
        await self.change({"VAL": self.user(self.axis.position)})

    # ---- what is no field of the record

    def extras(self) -> dict[str, Any]:
        """Names behind the record's, with what they show."""
        axis = self.axis
        return {
            "trust": axis.status["trust"], "selector": axis.status["selector"],
            "state": axis.status["state"], "fault": axis.fault,
            "fault_text": axis.fault_text[:200], "sample": str(axis.sample),
            "effort": float(axis.status["effort"] or 0.0),
        }  # fmt: skip


def name_of(face: str, address: str, port: int) -> tuple[str, str, int]:
    """Record, host and port of ``lab:m1`` or ``lab:m1@127.0.0.1:5064``."""
    name, _, place = address.partition("@")
    if not name or len(name) > 50 or any(not ((c.isascii() and c.isalnum()) or c in "_-:+[]<>;") for c in name):
        raise DetentError(f'{face}: got a record called {name!r:.60}; expected letters, digits and any of "_-:+[]<>;"')
    return (name, *address_of(face, place, port))
