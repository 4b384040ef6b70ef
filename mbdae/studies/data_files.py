"""Tables of times and signals in files: CSV, with units in headings, and Parquet, in SI units."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..tabular import Columns, read_csv
from ..units import require_kind
from .sweep.results_file import arrow


def read_columns(path: str | Path) -> Columns:
    """Return the columns of a file in SI, (n,) each, and the units of those with a unit in their heading.

    Raises:
        InputError: for a file that cannot be read, and as `mbdae.tabular.read_csv`.
    """
    if Path(path).suffix != ".parquet":
        return read_csv(path)
    parquet = arrow().parquet
    try:
        table = parquet.read_table(path)
        return Columns({name: np.array(table[name].to_pylist(), float) for name in table.column_names})
    except Exception as e:  # pyarrow has several exception types
        raise InputError(f"{path} cannot be read: {' '.join(str(e).split())}") from None


def check_headings(file: str, heading_units: Mapping[str, str], signal_units: Mapping[str, str]) -> None:
    """Reject a heading whose unit is not one of the signal of this name.

    Args:
        file: name of the file, for messages.
        heading_units: units in the headings, by column.
        signal_units: SI units of the signals, by name.

    Raises:
        InputError: names the column and lists its units.
    """
    for name in heading_units.keys() & signal_units.keys():
        require_kind(heading_units[name], signal_units[name], f"{file}: column {name!r}")
