"""Everything that turns sensation into activation."""
