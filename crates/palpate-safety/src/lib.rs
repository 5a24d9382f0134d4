//! The fail-safe layer between every command and every arm.
