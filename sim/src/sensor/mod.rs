//! Sensor models: what depth and colour look like after a real camera has had its way with them.
