"""Sources of events of a run (`mbdae.integrate.events.source`), and the location of events in steps."""
