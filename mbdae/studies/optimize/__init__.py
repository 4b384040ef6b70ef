"""Numbers of a mechanism by which it moves best: a bridge to `scipy.optimize`, with exact gradients."""
