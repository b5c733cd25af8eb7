"""Design ``measured``: known causes are added to records that somebody measured."""
