//! Learned force control for position-controlled robot arms: the composition root and its command line.
