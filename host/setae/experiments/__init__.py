"""Experiments: each is one module, driven through `setae.robot` and `setae.stage` alone."""
