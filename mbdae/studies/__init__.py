"""Studies: order, drift, cards, figures, replay and others."""
