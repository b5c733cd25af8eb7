"""What was measured, and whether it can be used: records, reading and conditioning."""

from rigsight.records.column_mapping import ColumnMapping as ColumnMapping
from rigsight.records.read_record import ReadingOptions as ReadingOptions
from rigsight.records.read_record import read_record as read_record
from rigsight.records.record import Floats as Floats
from rigsight.records.record import Hold as Hold
from rigsight.records.record import Kind as Kind
from rigsight.records.record import Record as Record
from rigsight.records.record import Role as Role
from rigsight.records.signals import is_constant as is_constant
