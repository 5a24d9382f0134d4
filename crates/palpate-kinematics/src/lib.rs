//! Forward kinematics, Jacobians and inverse kinematics of serial arms described by a URDF.
