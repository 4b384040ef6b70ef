"""The curve of closed configurations: steps along it, its branches, samples and special poses."""
