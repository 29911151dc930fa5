//! Scene to picture.
