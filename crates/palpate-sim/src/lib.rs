//! A rapier simulation of an arm, its force/torque sensor and tight-clearance contact.
