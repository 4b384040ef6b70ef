"""FMUs of other programs (FMI 2.0 and 3.0, co-simulation): interfaces, instances and saved states."""
