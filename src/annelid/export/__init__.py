"""A run taken elsewhere: tables, MATLAB, Parquet, pictures that move, a page, a model for plain MuJoCo."""

from annelid.export.formats import FORMATS, Format, find_format
from annelid.export.tables import Selection, selected

__all__ = ["FORMATS", "Format", "Selection", "find_format", "selected"]
