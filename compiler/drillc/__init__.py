"""drillc: compiles hole specs (`.drill`) into robot programs and proves what it emits."""

__version__ = "0.1.0"
