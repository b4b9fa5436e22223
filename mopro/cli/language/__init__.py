"""Commands on program files: compile, fmt, lint, lsp."""
