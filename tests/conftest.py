"""How property tests run: without a deadline per example (the first one may compile the model), or for long."""

from hypothesis import settings

settings.register_profile("suite", deadline=None)
settings.register_profile("fuzz", settings.get_profile("suite"), max_examples=1000)
settings.load_profile("suite")
