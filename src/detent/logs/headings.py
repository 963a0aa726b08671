"""What headings of recordings say: units, turned into factors to SI, and what a column can be.

A unit may carry a number: ``"0.3125 um"`` says that one unit of the column is 0.3125 µm, as for a column of encoder
counts. Counts themselves (``count``, ``steps``, ``pulses``) stay counts where nothing says how long one is. A share of
a rating is one of a stated value: ``"% of 2.4 N*m"``, ``"‰ of 5 A"``.
"""

import difflib
import re
import unicodedata
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from detent.units import MAX_TEXT, QuantityError, parse_quantity

COUNT_WORDS = frozenset(
    {"count", "counts", "cnt", "cnts", "cts", "inc", "incs", "increments", "pulses", "pulse", "ticks", "steps", "step"}
)
"""Words with which headings name counts."""

_WRITTEN_AS = {
    "°": "deg", "°/s": "deg/s", "degrees": "deg", "degree": "deg", "radians": "rad", "rads": "rad/s", "rad_s": "rad/s",
    "deg_s": "deg/s", "m_s": "m/s", "mm_s": "mm/s", "um_s": "um/s", "m_s2": "m/s^2", "mps": "m/s", "sec": "s",
    "secs": "s", "seconds": "s", "msec": "ms", "millis": "ms", "micros": "us", "usec": "us", "Nm": "N*m",
    "mNm": "mN*m", "Ncm": "N*cm", "kNm": "kN*m", "volt": "V", "volts": "V", "amp": "A", "amps": "A", "percent": "%",
    "1/min": "rpm", "U/min": "rpm", "rev/min": "rpm", "r/min": "rpm", "RPM": "rpm", "rps": "turn/s", "rev/s": "turn/s",
    "rev": "turn", "bit": "bits", "LSB": "lsb",
}  # fmt: skip
"""Ways of writing units that are common in headings, and what the parser of units calls them."""

_SHARE = re.compile(r"(%|‰|per ?mille|per ?cent) of (.+)", re.IGNORECASE)
_NO_UNIT = frozenset({"", "-", "1", "none", "lsb", "raw", "pu", "p.u."})
BITS = re.compile(r"([0-9]{1,2}) ?bits?", re.IGNORECASE)
_NUMBERED = re.compile(r"([+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?)\s*(.*)", re.DOTALL)
_OF_TURNS = re.compile(r"rad|deg|turn|rpm|revol|arc|grad")
_GRAVITIES = frozenset({"g", "g0", "gn"})
_CELSIUS, _FAHRENHEIT = (1.0, 273.15), (5 / 9, 459.67 * 5 / 9)
_TEMPERATURES = {"K": (1.0, 0.0), "degC": _CELSIUS, "C": _CELSIUS, "degF": _FAHRENHEIT, "F": _FAHRENHEIT}
_BRACKETED = re.compile(r"(.*?)\s*[\[(（［【]\s*([^\[\]()（）［］【】]*?)\s*[\])）］】]\s*", re.DOTALL)
_AFTER_NAME = (re.compile(r"(.*?\S)(?:\s*[/,]\s*| in | en )(\S+)"), re.compile(r"(.*\S)[_ ](\S+)"))
_SUFFIXES = frozenset(
    {"s", "ms", "us", "ns", "sec", "m", "mm", "um", "nm", "cm", "in", "rad", "deg", "rpm", "turn", "rev", "V", "mV",
     "A", "mA", "N", "Nm", "mNm", "K", "degC", "rads", "rad_s", "deg_s", "m_s", "mm_s", "um_s", "m_s2", "usec", "msec",
     "m/s", "mm/s", "rad/s", "deg/s", "m/s^2"}
)  # fmt: skip
"""Units that the last word of a name may be."""

_COMMON_TARGETS = ("s", "m", "count", "V", "A", "N", "rad", "m/s", "rad/s", "m/s^2", "N*m", "K", "")
_MOTION = (("m", "rad", "count"), ("m/s", "rad/s", "count/s"), ("m/s^2", "rad/s^2", "count/s^2"))
EFFORTS = ("force", "torque", "current", "voltage", "command")  # what can drive an axis, nearest to its mechanics first

DERIVED = frozenset(
    {"error", "err", "deviation", "lag", "term", "index", "sample", "number", "count", "gain", "filtered"}
)
"""Words in the name of a column that say that it is computed from others, or is none of these."""

_MARKS = {
    "velocity": {"velocity", "speed", "vel"},
    "acceleration": {"acceleration", "accel", "acc"},
    "enabled": {"enable", "enabled"},
}

_ANY = frozenset({"actual", "measured", "measured motor"})
"""Names that fit every measured signal: they say position where nothing else in a heading says more."""

_LAST = frozenset({"cur", "curr"})
"""Names that say something else before other words: motor cur is a current, cur pos the position of now."""

_TOKEN = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[0-9]+|[^\W\d_a-zA-Z]+")
_SAID_AS = {
    "time": "zeit zeitpunkt tiempo temps tempo 时间 時間 时刻",
    "timestamp": "zeitstempel horodatage 时间戳",
    "position": "lage weg posicion posizione 位置 位移",
    "angle": "winkel angulo angolo 角度 转角",
    "velocity": "geschwindigkeit drehzahl velocidad vitesse velocita 速度 转速 回転数",
    "acceleration": "beschleunigung aceleracion accelerazione 加速度",
    "force": "kraft fuerza forza 推力",
    "torque": "drehmoment couple par coppia 转矩 扭矩 力矩 トルク",
    "current": "strom corriente courant corrente intensite intensidad 电流 電流",
    "voltage": "spannung tension voltaje tensione 电压 電圧",
    "temperature": "temperatur temperatura 温度",
    "command": "stellgrosse stellgroesse stellwert commande comando 控制量 占空比",
    "actual": "ist istwert reel reelle real reale actuel actuelle 实际 実",
    "measured": "gemessen gemessene mesure mesuree medida medido misurata 测量",
    "target": "soll ziel cible objetivo obiettivo 目标 目標",
    "setpoint": "sollwert consigne consigna 设定 给定 指令",
    "motor": "moteur motore 电机 モータ",
    "load": "last charge carga carico 负载",
    "encoder": "geber codeur codificador 编码器",
    "enabled": "freigabe habilitado 使能",
    "error": "schleppfehler schleppabstand regelabweichung fehler erreur ecart desviacion 误差 偏差",
    "value": "wert valor valeur valore 值",
}  # fmt: skip
"""Words of headings in German, Spanish, French, Italian, Chinese and Japanese, without accents, by ours."""
_OURS = {word: ours for ours, said in _SAID_AS.items() for word in said.split()}
# Words that are written together, as in Lageistwert or 实际位置: known ones all through, the longest first.
_PARTS = re.compile("|".join(sorted({*_OURS, *_SAID_AS, "regler"}, key=len, reverse=True)))
_LEAST_FUZZY = 6


class Conversion(NamedTuple):
    """``value = factor * number + offset``, the value in `unit`."""

    unit: str
    factor: float
    offset: float = 0.0


def split_heading(cell: str) -> tuple[str, str]:
    """Name and unit of a heading; an empty unit where it states none.

    >>> split_heading("position [mm]"), split_heading("time(ms)"), split_heading("enc1_mm"), split_heading("t/s")
    (('position', 'mm'), ('time', 'ms'), ('enc1', 'mm'), ('t', 's'))
    >>> split_heading("motor.velocity")
    ('motor.velocity', '')
    """
    match = _BRACKETED.fullmatch(cell)
    if match and match[1]:
        return match[1], match[2]
    for length, pattern in ((1, _AFTER_NAME[0]), (2, _AFTER_NAME[1]), (1, _AFTER_NAME[1])):
        match = pattern.fullmatch(cell)
        if match is None:
            continue
        name, unit = match[1], match[2]
        if length == 2:  # a unit of two words, as in speed_mm_s
            name, _, before = name.rpartition("_")
            unit = f"{before}_{unit}"
        if name and (unit in _SUFFIXES or unit.lower() in COUNT_WORDS):
            return name, unit
    return cell, ""


def is_unit(text: str) -> bool:
    """True for a text that a row of units could hold."""
    return text in _NO_UNIT or any(find_conversion(text, unit) is not None for unit in _COMMON_TARGETS)


@lru_cache(4096)  # each column is compared with every unit of every role, and what does not fit costs the most
def find_conversion(text: str, unit: str) -> Conversion | None:
    """How numbers in a unit become numbers in another; None where the text is no unit of this kind.

    >>> find_conversion("0.5 mm", "m")
    Conversion(unit='m', factor=0.0005, offset=0.0)
    >>> find_conversion("steps", "count"), find_conversion("steps", "m")
    (Conversion(unit='count', factor=1.0, offset=0.0), None)
    >>> find_conversion("% of 2.5 N*m", "N*m")
    Conversion(unit='N*m', factor=0.025, offset=0.0)
    """
    match = _NUMBERED.fullmatch(text.strip())
    number, name = (match[1], match[2]) if match else ("1", text.strip())
    if len(text) > MAX_TEXT:
        return None
    if share := _SHARE.fullmatch(name):
        rated = find_conversion(share[2].strip(), unit)
        hundred = 100 if share[1] == "%" or "cent" in share[1].lower() else 1000
        return rated and rated._replace(factor=float(number) * rated.factor / hundred)
    name = _WRITTEN_AS.get(name, name).replace("µ", "u").replace("μ", "u").replace("°", "deg")
    if unit == "K":  # steps of several degrees do not exist
        return Conversion("K", *_TEMPERATURES[name]) if name in _TEMPERATURES and float(number) == 1 else None
    if unit == "":
        as_it_stands = float(number) if name.lower() in _NO_UNIT else None
        factor = {"%": float(number) / 100, "‰": float(number) / 1000, "bits": 1.0}.get(name, as_it_stands)
    elif unit.startswith("count"):
        head, slash, rest = name.partition("/")
        factor = float(number) if head.lower() in COUNT_WORDS and f"count{slash}{rest}" == unit else None
    elif unit == "m/s^2" and name in _GRAVITIES:
        factor = float(number) * 9.80665
    elif ("rad" in unit) != bool(_OF_TURNS.search(name)):
        factor = None  # the parser takes angles and counts for pure numbers
    else:
        try:
            factor = parse_quantity(f"{number} {name}", unit)
        except QuantityError:
            factor = None
    return None if factor is None else Conversion(unit, factor)


@dataclass(frozen=True, slots=True)
class Role:
    """What a signal is."""

    name: str  # key of the signal
    meaning: str  # what it is, for messages and the documentation
    # units that it may have behind the border: of an axis that moves straight, of one that turns, in counts
    units: tuple[str, ...]
    # what columns of it are called, the most telling first: words in small letters, to be found whole and in order
    names: tuple[str, ...]


ROLES: dict[str, Role] = {
    role.name: role
    for role in (
        Role("time", "time", ("s",), ("t", "time", "timestamp", "time stamp", "stamp", "ts", "elapsed", "clock")),
        Role("reference", "position asked for", _MOTION[0],
             ("reference position", "position reference", "pos ref", "position ref", "ref", "reference", "setpoint",
              "set point", "goal position", "target position", "demand position", "goal", "target",
              "desired", "demand", "commanded position", "position command", "qg", "qref", "xref")),
        Role("position_load", "position by a second encoder, at the load", _MOTION[0],
             ("load position", "position load", "load encoder", "encoder load", "enc load", "load angle", "enc 2",
              "encoder 2", "enc2", "position 2", "pos 2", "encoder2", "pos2")),
        Role("position", "position as measured", _MOTION[0],
             ("position meas", "measured position", "actual position", "position", "pos", "enc", "encoder", "angle",
              "theta", "phi", "readback", "rbv", "measured", "measured motor", "actual", "enc1", "encoder1", "pos1",
              "qm", "q", "x")),
        Role("velocity", "velocity as measured", _MOTION[1],
             ("velocity meas", "measured velocity", "actual velocity", "velocity", "speed", "vel", "omega", "rpm", "qd",
              "dq", "v")),
        Role("acceleration", "acceleration as measured", _MOTION[2], ("acceleration", "accel", "acc", "qdd", "ddq")),
        Role("force", "force of the drive on the axis", ("N",), ("motor force", "force", "thrust")),
        Role("torque", "torque of the motor", ("N*m",), ("motor torque", "torque", "tau", "moment")),
        Role("current", "current of the motor", ("A",),
             ("motor current", "current", "iq", "i q", "amps", "cur", "curr", "i")),
        Role("supply", "voltage that supplies the drive", ("V",),
             ("supply", "supply voltage", "bus voltage", "vbus", "v bus", "dc link", "input volts", "input voltage",
              "battery", "vin")),
        Role("voltage", "voltage at the motor or its amplifier", ("V",),
             ("motor voltage", "voltage", "volts", "u")),
        Role("command", "word to the drive, such as a duty cycle", ("",),
             ("control signal", "controlsignal", "control", "pwm", "duty", "duty cycle", "command", "cmd", "load",
              "effort", "input signal", "inputsignal", "drive")),
        Role("temperature", "temperature of the motor", ("K",), ("motor temperature", "temperature", "temp")),
        Role("enabled", "1 while the drive is on", ("",), ("torque enable", "enable", "enabled", "torque enabled")),
    )
}  # fmt: skip
"""Every role by its name; the order is that in which columns are looked for."""


@lru_cache(4096)
def words_of(name: str) -> tuple[str, ...]:
    """Words of a column's name, in small letters.

    >>> words_of("inputSignal"), words_of("goal_position"), words_of("enc1")
    (('input', 'signal'), ('goal', 'position'), ('enc', '1'))
    >>> words_of("Lageistwert"), words_of("Vitesse mesurée"), words_of("实际位置")
    (('position', 'actual'), ('velocity', 'measured'), ('actual', 'position'))
    """
    letters = unicodedata.normalize("NFKD", name).replace("ß", "ss")
    plain = "".join(letter for letter in letters if not unicodedata.combining(letter))
    return tuple(word for token in _TOKEN.findall(plain) for word in _in_our_words(token.lower()))


def _in_our_words(token: str) -> list[str]:
    """Our words for one of another language, or for several that are written together; otherwise the word itself."""
    parts: list[str] = _PARTS.findall(token)
    is_whole = sum(map(len, parts)) >= len(token) - ("s" in token)  # German joins with an s
    return [_OURS.get(part, part) for part in parts] if parts and is_whole else [token]


def rank(name: str, role: str) -> int | None:
    """How well the name of a column fits a role.

    >>> rank("Time", "time"), rank("Current Error", "current"), rank("enconder", "position") is not None
    (1, None, True)
    >>> rank("actual_q_0", "position") is not None, rank("actual_current_0", "position")
    (True, None)
    """
    words = words_of(name)
    if not words or DERIVED & set(words):
        return None
    others = (known for other in ROLES.values() if other.name != role for known in other.names)
    is_other = bool(_ANY & set(words)) and any(_contains(words, known) for known in others)
    for place, known in enumerate(ROLES[role].names):
        if _contains(words, known) and not _means_other(words, known, role) and not (is_other and known in _ANY):
            return place
    return None


def _contains(words: tuple[str, ...], known: str) -> bool:
    """True where the known words stand whole and in their order in a name; a single letter must be all of it."""
    sought = words_of(known)
    if sum(map(len, sought)) <= 1:
        return words == sought
    rest = iter(words)
    return all(any(_is_same(word, wanted) for word in rest) for wanted in sought) or "".join(words) == "".join(sought)


def _is_same(word: str, wanted: str) -> bool:
    """True for a word, or a long one that is misspelled."""
    is_long = len(wanted) >= _LEAST_FUZZY
    return word == wanted or (is_long and difflib.SequenceMatcher(None, word, wanted).ratio() > 0.88)


def _means_other(words: tuple[str, ...], known: str, role: str) -> bool:
    """True where other words of a name say that it is something else, as in target velocity."""
    others = set(words) - set(words_of(known))
    if any(others & marks for meant, marks in _MARKS.items() if role != meant):
        return True
    if known in _LAST and known != next(word for word in reversed(words) if not word.isdigit()):
        return True
    asked = {"target", "goal", "reference", "ref", "desired", "setpoint", "demand", "demanded", "commanded"}
    return role in {"position", "velocity", "acceleration", "current", "force", "torque"} and bool(others & asked)
