"""Fields of others, and of users, from configuration."""

from importlib import import_module

from torch import nn

from geomotion import config as schema
from geomotion.baselines.elcd import ExtendedLinearField
from geomotion.baselines.euclideanizing_flow import NaturalDescent
from geomotion.baselines.imitation_flow import StochasticDrift
from geomotion.baselines.movement_primitive import MovementPrimitive
from geomotion.baselines.seds import StableGaussianMixture
from geomotion.dynamics.fields import VectorField
from geomotion.errors import InvalidSetting


def build_anchored(config: schema.AnchoredField, dim: int) -> VectorField:
    """An untrained field in coordinates whose origin is the goal.

    Raises:
        InvalidSetting: If a user's class is no field, or does not take the settings.
    """
    match config:
        case schema.SedsField():
            return StableGaussianMixture(dim, config.components, config.min_rate_per_duration)
        case schema.EuclideanizingFlowField():
            return NaturalDescent(dim, config.hidden_units, config.activation.value)
        case schema.ImitationFlowField():
            return StochasticDrift(dim, config.drift is schema.LatentDrift.saturated, config.initial_std)
        case schema.ElcdField():
            rate = config.min_rate_per_duration
            return ExtendedLinearField(dim, config.hidden_units, config.activation.value, rate)
        case schema.MovementPrimitiveField():
            return MovementPrimitive(dim, config.weights)
        case schema.CustomField():
            return _custom(config, dim)
        case unknown:
            raise TypeError(f"no builder for {type(unknown).__name__}")


def _custom(config: schema.CustomField, dim: int) -> VectorField:
    module, _, name = config.target.rpartition(".")
    try:
        kind = getattr(import_module(module), name, None)
    except Exception as error:  # whatever the user's file raises
        raise InvalidSetting(
            "field.target", config.target, f"a file that can be imported ({type(error).__name__}: {error})"
        ) from error
    if not (isinstance(kind, type) and issubclass(kind, nn.Module)):
        raise InvalidSetting("field.target", config.target, f"a class of {module} that derives from torch.nn.Module")
    try:
        field = kind(dim, **config.settings)
    except TypeError as error:
        raise InvalidSetting("field.settings", config.settings, f"what {config.target} takes ({error})") from error
    if getattr(field, "dim", None) != dim or not any(True for _ in field.parameters()):
        raise InvalidSetting(
            "field.target", config.target, f"a module with parameters and an attribute dim ({dim} here)"
        )
    assert isinstance(field, VectorField)
    return field
