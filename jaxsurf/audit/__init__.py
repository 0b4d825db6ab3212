from ._continuity import Continuity as Continuity, continuity as continuity
