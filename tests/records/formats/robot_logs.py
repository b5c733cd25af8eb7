"""Bags as robots log them, written for tests."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

START = 1_700_000_000_000_000_000


def bag(path: Path, messages: Any, definitions: Mapping[str, str] | None = None) -> Path:
    """Write messages (topic, type, received [ns], fields) into an MCAP file, also of types that are defined here."""
    rosbag2, typesys = pytest.importorskip("rosbags.rosbag2"), pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    for name, fields_of_it in (definitions or {}).items():
        store.register(typesys.get_types_from_msg(fields_of_it, name))

    def built(kind: str, fields: dict[str, Any]) -> Any:
        return store.types[kind](**fields)

    topics: dict[str, Any] = {}
    with rosbag2.Writer(path, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP) as file:
        for topic, kind, received, fields in messages(built):
            if topic not in topics:
                topics[topic] = file.add_connection(topic, kind, typestore=store)
            file.write(topics[topic], received, store.serialize_cdr(built(kind, fields), kind))
    return path / f"{path.name}.mcap"


def joint_state(built: Any, stamp: int, names: list[str], position: list[float]) -> dict[str, Any]:
    time = built("builtin_interfaces/msg/Time", {"sec": stamp // 10**9, "nanosec": stamp % 10**9})
    header = built("std_msgs/msg/Header", {"stamp": time, "frame_id": ""})
    empty = np.zeros(0)
    return {
        "header": header,
        "name": names,
        "position": np.array(position),
        "velocity": empty,
        "effort": empty,
    }
