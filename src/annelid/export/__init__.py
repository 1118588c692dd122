"""A run taken elsewhere: tables, MATLAB, Parquet, pictures that move, a page, a model for plain MuJoCo.

`formats` lists the formats and is the one way in; `selection` cuts a run down to what is wanted; `tables` lays its
signals out as tidy tables, which `delimited` and `parquet` write.
"""

from annelid.export.formats import FORMATS, Format, find_format
from annelid.export.selection import Selection, selected

__all__ = ["FORMATS", "Format", "Selection", "find_format", "selected"]
