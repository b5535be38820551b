"""The link's protocol: messages, frames and their one schema."""
