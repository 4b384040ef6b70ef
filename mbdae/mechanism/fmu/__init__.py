"""FMUs (FMI 2.0 and 3.0, co-simulation) of other programs: what they have, instances, and their saved states."""
