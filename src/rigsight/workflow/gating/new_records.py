"""Which records does a gate ask? Those of a campaign, or files that are read as the campaign of the model reads its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rigsight.effects import Effect
from rigsight.errors import InputError
from rigsight.records import Record
from rigsight.records.read_record import read_stretches
from rigsight.rigs import Rig
from rigsight.simulate.model import Model
from rigsight.workflow.campaign.campaign_file import RecordTable, locate, read_campaign_table
from rigsight.workflow.campaign.model_file import of_this_rig
from rigsight.workflow.campaign.read_campaign import options_of, read_campaign, read_listed_record
from rigsight.workflow.campaign.record_notes import in_units_of

_OF_ITS_OWN = {"name": None, "start": None, "end": None, "amplitude": None, "role": "validation"}
"""What the first record of a campaign says of itself and not of others."""


@dataclass(frozen=True)
class Reader:
    """Reads records of the rig of a model."""

    model: Model
    campaign: Path | None  # of which the first record says how files are read
    own_effects: Sequence[Effect]
    own_rigs: Sequence[Rig]

    def read(self, paths: Sequence[str | Path]) -> list[Record]:
        """Return the records of campaigns and files, with names of their own."""
        found = [record for path in paths for record in self._of(Path(path))]
        named: dict[str, Record] = {}
        for record in found:
            name, count = record.name, 1
            while name in named:
                count += 1
                name = f"{record.name}_{count}"
            named[name] = replace(record, name=name)
        return list(named.values())

    def of_campaign(self, path: Path) -> tuple[Record, ...]:
        """Return all records of a campaign."""
        campaign = read_campaign(path, self.own_effects, self.own_rigs)
        of_this_rig("MODEL", self.model, campaign)
        return campaign.records

    def _of(self, path: Path) -> Sequence[Record]:
        if not path.exists():
            raise InputError(
                f"{path} does not exist; name a campaign.toml, the folder that contains it, or a measured file."
            )
        if path.is_dir() or path.suffix == ".toml":
            return self.of_campaign(path)
        rig = self.model.structure.rig
        if self.campaign is None:
            read = read_stretches(
                path, rig.inputs, rig.outputs, replace(options_of(rig), hold=self.model.hold)
            )
        else:
            read = self._as_in_campaign(self.campaign, path)
        return [in_units_of(rig, record) for record in read]

    def _as_in_campaign(self, campaign: Path, path: Path) -> tuple[Record, ...]:
        toml = locate(campaign)
        table, where = read_campaign_table(toml)
        first: RecordTable = table.records[0].model_copy(update={**_OF_ITS_OWN, "file": path.name})
        joined = [
            column
            for column in first.columns.values()
            if not isinstance(column, str | int) and column.file is not None
        ]
        if joined:
            raise InputError(
                f"{where.at('records', 0, 'columns')}: takes signals from further files, so {path.name} alone is no record. Give "
                "the new records as a campaign.toml."
            )
        records = read_listed_record(
            toml, self.model.structure.rig, 1, first, path, where, table.rig.constants
        )
        outputs = [signal.name for signal in self.model.structure.rig.outputs]
        if table.offsets == "per_record":
            return tuple(record.with_free_offsets(outputs) for record in records)
        return records
