"""Models of robots that other simulators run: MJCF and URDF to a rig file that is checked, numbers and effects back to them."""

from rigsight.robots.draft import RigDraft, draft_rig
from rigsight.robots.free_run import FreeRun, free_run
from rigsight.robots.isaac import isaac_settings
from rigsight.robots.loading import load_model
from rigsight.robots.rig_text import rig_text
from rigsight.robots.writing_back import WrittenBack, write_back

__all__ = [
    "FreeRun",
    "RigDraft",
    "WrittenBack",
    "draft_rig",
    "free_run",
    "isaac_settings",
    "load_model",
    "rig_text",
    "write_back",
]
