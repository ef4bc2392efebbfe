"""The same work by ours and by what one would use instead: error, time and memory side by side."""

from kappaskin.studies.compare.measure import Compared as Compared
from kappaskin.studies.compare.measure import compared as compared
from kappaskin.studies.compare.table import compared_text as compared_text
from kappaskin.studies.compare.table import errors_text as errors_text
