"""The dated positions of a mine's face, from the mine file or from recorded data."""

from catalogs.records.elk_creek_reader import data_folder
from catalogs.settings import FacePosition, FaceSettings, by_panel
from workflow.mine_configuration import MineConfiguration


def face_positions(mine: MineConfiguration) -> list[dict]:
    """Positions of the panels that begin before the last dated step ends, as plain values; empty without a face.

    Raises InputError for data that cannot be read, or hold positions that the mine file could not.
    """
    settings = mine.settings.face
    if settings is None:
        return []
    positions = settings.positions or _elk_creek(mine, settings)
    ends = [step.end for step in mine.listed_steps if step.is_dated]
    begun = [one for one in by_panel(positions).values() if not ends or one[0].date < ends[-1]]
    return [position.given() for panel in begun for position in panel]


def _elk_creek(mine: MineConfiguration, settings: FaceSettings) -> tuple[FacePosition, ...]:
    """Dated by the local day, which counts here as one of UTC: the face is wrong by what it advances in some hours."""
    import pandas as pd  # here, and the reader of drawings and tables: they take seconds

    from workflow.mines.elk_creek import read_panels

    listed = [
        {
            "date": pd.Timestamp(seconds, unit="s").isoformat().removesuffix("T00:00:00"),
            "ends": [headgate.tolist(), tailgate.tolist()],
            "panel": panel.name,
        }
        for panel in read_panels(data_folder(mine.path(settings.folder), "face.folder"))
        for seconds, headgate, tailgate in zip(panel.date, panel.headgate, panel.tailgate, strict=True)
    ]
    return FaceSettings.of({"positions": listed}, "face").positions
