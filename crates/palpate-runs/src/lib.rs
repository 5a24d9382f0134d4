//! The run directory: configuration, metrics, checkpoints, plots and provenance.
