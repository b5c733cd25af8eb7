"""Signal and unit suggested by the name of a channel."""

from __future__ import annotations

import re

# In English and German, as rigs are labeled; the shorter and plainer the earlier.
NAMES_OF: dict[str, tuple[str, ...]] = {
    "t": ("t", "time", "zeit", "times", "timestamp", "time stamp", "elapsed time", "tout", "x value"),
    "u": (
        "u", "input", "current", "strom", "motor current", "motorstrom", "i", "voltage", "spannung", "drive", "command",
        "control", "excitation", "anregung", "stellgröße", "drive force", "antriebskraft", "torque", "drehmoment", "effort",
        "pwm", "duty", "duty cycle", "cmd", "torque cmd", "torque command", "current cmd", "voltage cmd", "force cmd",
    ),
    "psi": ("psi", "yaw", "yaw angle", "gierwinkel", "wendewinkel"),
    "y": ("y", "lateral", "lateral displacement", "lateral position", "querverschiebung", "spurlage"),
    "x": ("x", "position", "displacement", "weg", "pos", "auslenkung", "stroke", "travel", "hub", "deflection"),
    "angle": ("angle", "winkel", "q", "theta", "position", "pos"),
    "speed": ("speed", "velocity", "geschwindigkeit", "drehzahl", "vel", "qd", "dq"),
    "velocity": ("velocity", "speed", "geschwindigkeit", "drehzahl", "vel", "qd", "dq"),
    "torque": ("torque", "drehmoment", "moment", "effort", "tau"),
    "reference": ("reference", "ref", "setpoint", "set point", "goal", "sollwert", "führungsgröße"),
    "force": ("force", "kraft", "f", "load", "last", "damper force", "dämpferkraft"),
}  # fmt: skip
_SYMBOLS = ("t", "u", "psi", "y", "x", "reference", "force")
"""Of built-in rigs: too short or too common for a channel that has them among other words."""
_IN_PART = 0.9
"""Below what a unit that fits makes clear: a word that is shared is a hint, no more."""
_QUANTITIES = {
    "angle": ("position", "positions", "pos", "q", "state"),
    "slide": ("position", "positions", "pos", "q", "state"),
    "speed": ("velocity", "velocities", "vel", "qd", "dq"),
    "velocity": ("speed", "velocities", "vel", "qd", "dq"),
    "torque": ("effort", "tau", "current"),
    "force": ("effort", "current"),
    "ctrl": ("effort", "command", "commands", "action", "tau", "current"),
}
"""What a log of a robot calls the quantities of its joints."""
_COMMANDED = frozenset({
    "action", "cmd", "command", "commanded", "commands", "desired", "goal", "goals", "reference", "setpoint", "target", "targets",
})  # fmt: skip
_MEASURED = frozenset({"actual", "feedback", "measured", "observation", "state", "states"})
_NO_READING = _COMMANDED | {"error", "output"}
_SAID = {
    "position": frozenset({"angle", "pos", "position", "positions"}),
    "velocity": frozenset({"speed", "vel", "velocities", "velocity"}),
    "effort": frozenset({"current", "effort", "efforts", "force", "tau", "torque"}),
}
_OF_UNIT = {
    "rad": "position",
    "m": "position",
    "rad/s": "velocity",
    "m/s": "velocity",
    "N m": "effort",
    "N": "effort",
}
_FILLERS = frozenset({"motor", "joint", "actuator"})
# A last word without brackets is a unit only if it can hardly be anything else: x_a is no length of years.
_UNITS_BEHIND = frozenset({
    "s", "ms", "us", "µs", "A", "mA", "V", "mV", "N", "kN", "mN", "Nm", "kNm",
    "m", "mm", "cm", "um", "µm", "rad", "mrad", "deg", "°",
})  # fmt: skip
_IN_BRACKETS = re.compile(
    r"^(?P<bare>.*?)\s*[\[(<]\s*(?P<unit>[^\[\]()<>]*?[^\W\d_][^\[\]()<>]*?|[%°])\s*[\])>]\s*$"
)
_RATE_BEHIND = re.compile(
    r"^(?P<bare>.+?)(?:\s+(?:in\s+)?|_in_|_)(?P<way>m|mm|cm|rad|mrad|deg|(?:in|ft)(?=_per_|/))(?:_per_|_|/)s$"
)
_BEHIND = re.compile(r"^(?P<bare>.+?)(?:\s+(?:in\s+)?|_in_|_|,\s*)(?P<unit>[A-Za-zµμ°]+)$")


def split_unit(name: str) -> tuple[str, str | None]:
    """Return a channel's name without its unit, and the unit: ``"Kraft [kN]"``, ``"Weg mm"``, ``"speed_rad_s"``."""
    match = _IN_BRACKETS.match(name)
    # A number in brackets is a place: data(:,1), control[0].
    if match and re.search(r"[^\W\d_]|[°%]", match["unit"]):
        return match["bare"], match["unit"]
    match = _RATE_BEHIND.match(name)
    if match:
        return match["bare"], f"{match['way']}/s"
    match = _BEHIND.match(name)
    if match and match["unit"] in _UNITS_BEHIND and not match["bare"].endswith("per"):
        return match["bare"], match["unit"]
    return name, None


def closeness(name: str, signal: str) -> float:
    """Return how well a channel's name, without group and unit, fits a signal, from 0 (not at all) to 3 (its own name)."""
    if signal in (name, name.rpartition("/")[2]):
        return 3.0
    bare = split_unit(name)[0]
    whole, last = _plain(bare), _plain(bare.rpartition("/")[2])
    words, asked = _words(bare.rpartition("/")[2]), _words(signal)
    if signal.lower() in (whole, last) or (asked and asked in (_words(bare), words)):
        return 3.0
    known = NAMES_OF.get(signal, ())
    if whole in known or last in known:
        return 2.0
    single = set(last.split())
    by_other_names = 1.0 if any(word in single for word in known if len(word) > 2) else 0.0
    if signal in _SYMBOLS:
        return by_other_names
    # A name from a rig file: its words may be in another order or among others.
    own, inside = set(asked.split()), set(words.split())
    shared = own & inside
    if all(word.isdigit() for word in shared):
        shared = set()
    if shared and "/" in bare:
        # A log of a robot has a group for each quantity, and in it the joints: position/elbow.
        own = own - _FILLERS or own
        inside |= set(_words(bare.split("/")[-2]).split())
        if is_command(bare):
            inside.add("command")
        shared = {word for word in own if inside & {word, *_QUANTITIES.get(word, ())}}
    by_words = 2.0 if own and shared == own else _IN_PART * len(shared) / max(1, len(own))
    return max(by_words, by_other_names)


def is_command(name: str) -> bool:
    """Return True for the channel of a log, which has groups, that is called like a command."""
    return "/" in name and bool(_COMMANDED & set(_words(name).split()))


def may_be_reading(name: str, unit: str) -> bool:
    """Return False for the channel of a log that is called like anything but a reading, or one of another unit."""
    words = set(_words(name).split())
    return not ("/" in name and _NO_READING & words) and _may_have(words, unit)


def may_be_command(name: str, unit: str) -> bool:
    """Return False for the channel of a log that is called like a reading, or like a command of another unit."""
    # A measured effort drives as well.
    words = set(_words(name).split())
    is_read = "/" in name and _MEASURED & words and not (_SAID["effort"] | _COMMANDED) & words
    return not is_read and "error" not in words and _may_have(words, unit)


def _may_have(words: set[str], unit: str) -> bool:
    said = {quantity for quantity, names in _SAID.items() if names & words}
    return not said or unit not in _OF_UNIT or _OF_UNIT[unit] in said


def plain_words(name: str) -> str:
    """Return a name without its unit in lower case, words apart."""
    return _words(split_unit(name)[0])


def _plain(name: str) -> str:
    """Return a name in lower case, words apart, without a device in front (``a1 torque``) and numbers at its end."""
    words = _words(name)
    return re.sub(r"^(?:[a-z]{1,6}\d+ )+|\s*\d+$", "", words) or words


def _words(name: str) -> str:
    """Return a name in lower case, words apart."""
    return re.sub(r"[\W_]+", " ", re.sub(r"([a-zäöü])([A-ZÄÖÜ])", r"\1 \2", name)).lower().strip()
