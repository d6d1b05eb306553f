"""Load path of a contact: contact solver, Newton, steps, balances, checkpoints."""
