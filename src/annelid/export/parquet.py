"""Tables as Parquet, with units in the metadata of every field."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from annelid.export.tables import Table
from annelid.output import whole_file


def write_parquet(table: Table, path: Path, facts: dict[str, Any]) -> Path:
    """Writes a table as one Parquet file.

    Args:
        table: The table; every field's metadata has ``units`` and ``long_name``.
        path: File to write.
        facts: What the run is; JSON in the schema's metadata, under ``annelid``.

    Raises:
        RunFileError: The file cannot be written.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    fields, arrays = [], []
    for column in table.columns:
        array = pa.array(column.values.tolist() if column.values.dtype.kind in "UO" else column.values)
        meaning = {"units": column.units, "long_name": column.long_name}
        fields.append(pa.field(column.name, array.type, metadata=meaning))
        arrays.append(array)
    schema = pa.schema(fields, metadata={"annelid": json.dumps(facts)})
    with whole_file(path) as draft:
        pq.write_table(pa.Table.from_arrays(arrays, schema=schema), draft)
    return path
