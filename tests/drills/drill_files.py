"""Files that declare far more than they hold: refused with little memory, in little time."""
