"""Studies of mechanisms: runs, errors, statics, design, figures and replays."""
