"""The messages of the wire contract, generated from proto/palpate/v1."""

from .archive_pb2 import *
from .candidate_pb2 import *
from .contact_pb2 import *
from .event_pb2 import *
from .exploration_service_pb2 import *
from .geometry_pb2 import *
from .mesh_pb2 import *
from .reconstruction_service_pb2 import *
from .session_pb2 import *
from .session_config_pb2 import *
from .session_service_pb2 import *
from .strategy_pb2 import *
from .stream_pb2 import *
from .visual_prior_pb2 import *
from .warning_pb2 import *
