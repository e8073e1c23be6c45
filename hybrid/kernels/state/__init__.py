"""What everyone below reads: fields of a line, state, books of a run, numbers of a report, bits of forces."""
