"""One run of a model: simulated, saved, replayed, plotted."""
