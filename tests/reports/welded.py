"""Two pouches on each other, whose rims are welded one over the other."""

DOUBLE = """
name = "double"
family = "drawn"
layers = [
  {role = "base", shape = "film", film = "pe"},
  {role = "wall", shape = "film", film = "pe"},
  {role = "cap", shape = "film", film = "CAP"},
]
seams = [
  {name = "upper", layers = [2, 3], path = RIM, width = 2, tool = "hot-tip"},
  {name = "lower", layers = [1, 2], path = RIM, width = 2, tool = "hot-tip"},
]
chambers = [
  {name = "low", centres = [[0, 0]], mouth = [0, 24], angle = 90, width = 2, balloons = [1]},
  {name = "high", centres = [[0, 0]], mouth = [0, 24], angle = 90, width = 2, balloons = [2]},
]
[shapes]
body = {polygon = [[-20, -14], [22, -14], [22, 13], [-20, 13]]}
tab = {polygon = [[-3, 0], [3, 0], [3, 24], [-3, 24]]}
film = {union = ["body", "tab"]}
[films.pe]
kind = "structural"
product = "LDPE"
thickness = 0.1
melting_point = 110
[films.pet]
kind = "structural"
product = "PET"
thickness = 0.05
""".replace(
    "RIM", "[[-2, 25], [-2, 12], [-19, 12], [-19, -13], [19, -13], [19, 12], [2, 12], [2, 25]]"
)
