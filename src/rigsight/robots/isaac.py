"""Parameter values and effects of a model -> the settings of Isaac Lab's actuators, a group for each joint.

Written for Isaac Lab 3.0 (`isaaclab.actuators.ActuatorBaseCfg`, `DelayedPDActuatorCfg`). Friction of joints is there since Isaac
Sim 5.0; 2.x calls ``actuator_effort_limit`` ``effort_limit``.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rigsight.errors import InputError
from rigsight.robots.joint_settings import joint_settings
from rigsight.robots.writing_back import WrittenBack
from rigsight.simulate.model import Model


def isaac_settings(model: Model, source: Path, step: float | None = None) -> WrittenBack:
    """Return the YAML of Isaac Lab's actuators for a model that was made from an MJCF or URDF file."""
    try:
        import yaml
    except ImportError:
        raise InputError(
            "Writing for Isaac Lab needs PyYAML, which is not installed: pip install 'rigsight[mujoco]'."
        ) from None
    settings = joint_settings(model, source, step)
    groups = {
        joint.name: {"joint_names_expr": [joint.name], **_group(joint.values, settings.step)}
        for joint in settings.joints
    }
    head = [
        f"Written by rigsight export from {source.name}, for Isaac Lab 3.0.",
        f"Delays are steps of the physics of {settings.step:g} s each.",
        *(f"Isaac Lab has no setting for {what}" for what in settings.without_field),
    ]
    text = "".join(f"# {line}\n" for line in head) + yaml.safe_dump({"actuators": groups}, sort_keys=False)
    return WrittenBack(text, settings.written, settings.without_field)


def _group(values: Mapping[str, float], step: float) -> dict[str, Any]:
    group: dict[str, Any] = {}
    for name, value in values.items():
        if name == "delay":
            group |= dict.fromkeys(("min_delay", "max_delay"), round(value / step))
        else:
            group["actuator_effort_limit" if name == "effort_limit" else name] = value
    return group
