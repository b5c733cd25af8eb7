"""Robot models of other simulators: from MJCF and URDF to a checked rig file, and parameters and effects back to them."""

from rigsight.robots.draft import RigDraft as RigDraft
from rigsight.robots.draft import RobotFile as RobotFile
from rigsight.robots.draft import read_robot as read_robot
from rigsight.robots.draft import rig_text as rig_text
from rigsight.robots.joint_settings import isaac_settings as isaac_settings
from rigsight.robots.runs import FreeRun as FreeRun
from rigsight.robots.runs import WrittenGap as WrittenGap
from rigsight.robots.runs import free_run as free_run
from rigsight.robots.runs import sensor_readings as sensor_readings
from rigsight.robots.tree import load_model as load_model
from rigsight.robots.tree import load_spec as load_spec
from rigsight.robots.usd import usd_layer as usd_layer
from rigsight.robots.writing_back import WrittenBack as WrittenBack
from rigsight.robots.writing_back import with_gears as with_gears
from rigsight.robots.writing_back import write_back as write_back
