"""A small radiance field in torch: a hash grid, a network for density and one for colour.

Rays are integrated as in NeRF (Mildenhall et al. 2020, equation 3). The hash grid follows Müller et
al. 2022. The contraction of space follows mip-NeRF 360 (Barron et al. 2022, equation 10). The field
also learns depth: a training ray has dense samples around its surface. The loss adds the negative
logarithm of the part of the light that comes from there.
"""

import torch
from torch import Tensor, nn
from torch.nn import functional

# Cells along a side of each level of the grid, entries of a level's table, values of an entry.
RESOLUTIONS = torch.tensor([16, 26, 43, 70, 115, 189, 311, 512])
ENTRIES = 1 << 16
FEATURES = 2
PRIMES = torch.tensor([1, 2654435761, 805459861])
HIDDEN = 32
# Metres. Rays that hit nothing have their surface at FAR.
NEAR = 0.1
FAR = 100.0
# Samples of a training ray before its surface.
BEFORE = 6
# Samples of a training ray around its surface, within BAND of its distance.
AROUND = 4
BAND = 0.03
# Samples of a rendered ray, from NEAR to FAR.
RENDERED = 256
# Rays that are rendered at once.
CHUNK = 256
DEPTH_WEIGHT = 0.1


class Field(nn.Module):
    """A radiance field around ``center`` (3,), finest within ``radius`` metres of it."""

    def __init__(self, center: Tensor, radius: float) -> None:
        super().__init__()
        self.center = center
        self.radius = radius
        # Density and colour each have values of their own, so that they do not disturb each other.
        entries = torch.empty(len(RESOLUTIONS) * ENTRIES, 2 * FEATURES)
        self.table = nn.Parameter(entries.uniform_(-1e-4, 1e-4))
        self.density = _network(len(RESOLUTIONS) * FEATURES, 1)
        self.colour = _network(len(RESOLUTIONS) * FEATURES + 9, 3)

    def forward(
        self, origins: Tensor, rays: Tensor, ends: Tensor, places: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Return the colour (n, 3) of unit rays, and the part (n, m) of it from each interval.

        Intervals are between ``ends`` (n, m + 1), in metres from ``origins`` (n, 3); the last end
        is inf. Each has a sample at ``places`` (n, m), from 0 to 1.
        """
        lengths = ends.diff().nan_to_num(posinf=0)
        along = ends[:, :-1] + places * lengths
        encoded = self._encode(origins[:, None] + rays[:, None] * along[..., None])
        of_density, of_colour = (part.flatten(-2) for part in encoded.split(FEATURES, dim=-1))
        density = self.density(of_density).squeeze(-1).clamp(-15, 12).exp()
        optical_depth = (density * lengths / self.radius).cumsum(dim=1)
        arriving = torch.exp(-functional.pad(optical_depth[:, :-1], (1, 0)))
        # The last interval takes what is left.
        weights = arriving - functional.pad(arriving[:, 1:], (0, 1))
        # All polynomials of degree 2 of a unit direction follow from these.
        direction = torch.cat([rays, rays * rays.roll(1, dims=-1), rays**2], dim=-1)
        direction = direction[:, None].expand(-1, along.shape[1], -1)
        colour = self.colour(torch.cat([of_colour, direction], dim=-1)).sigmoid()
        return (weights[..., None] * colour).sum(dim=1), weights

    def loss(self, origins: Tensor, rays: Tensor, colour: Tensor, distance: Tensor) -> Tensor:
        """Return the loss of unit rays (n, 3) of ``colour`` (n, 3), from 0 to 1.

        They meet the first surface at ``distance`` (n,) in metres, inf for none.
        """
        surface = distance.clamp(2 * NEAR, FAR)[:, None]
        before = NEAR * (surface * (1 - BAND) / NEAR) ** torch.linspace(0, 1, BEFORE + 1)[:-1]
        around = surface * torch.linspace(1 - BAND, 1 + BAND, AROUND + 1)
        ends = torch.cat([before, around, torch.full_like(surface, torch.inf)], dim=1)
        shown, weights = self(origins, rays, ends, torch.rand(len(rays), ends.shape[1] - 1))
        # A surface at FAR may also lie beyond it.
        from_surface = weights[:, BEFORE:-1].sum(dim=1) + weights[:, -1] * (distance >= FAR)
        depth_loss = -(from_surface + 1e-5).log().mean()
        return functional.mse_loss(shown, colour) + DEPTH_WEIGHT * depth_loss

    @torch.no_grad()
    def render(self, origins: Tensor, rays: Tensor) -> Tensor:
        """Return the colour (n, 3) of unit rays. Unlike in `loss`, their depth is not known."""
        finite_ends = NEAR * (FAR / NEAR) ** torch.linspace(0, 1, RENDERED)
        ends = functional.pad(finite_ends, (0, 1), value=torch.inf)[None]
        middle = torch.tensor(0.5)
        chunks = zip(origins.split(CHUNK), rays.split(CHUNK), strict=True)
        return torch.cat([self(start, ray, ends, middle)[0] for start, ray in chunks])

    def _encode(self, points: Tensor) -> Tensor:
        """Return the grid's values (…, levels, 2 * FEATURES) at points (…, 3) in metres."""
        local = (points - self.center) / self.radius
        away = local.norm(dim=-1, keepdim=True).clamp(min=1)
        unit = 0.5 + local * (2 - 1 / away) / away / 4
        scaled = unit[..., None, :] * RESOLUTIONS[:, None]
        cell = scaled.floor()
        inside = scaled - cell
        # The hashes and weights of the two sides of a cell along x, y and z; then of its 8 corners.
        x, y, z = (torch.stack([cell, cell + 1], dim=-2).long() * PRIMES).unbind(dim=-1)
        entry = (x[..., None, None] ^ y[..., None, :, None] ^ z[..., None, None, :]) % ENTRIES
        entry += torch.arange(len(RESOLUTIONS))[:, None, None, None] * ENTRIES
        x, y, z = torch.stack([1 - inside, inside], dim=-2).unbind(dim=-1)
        weight = x[..., None, None] * y[..., None, :, None] * z[..., None, None, :]
        # The gradient sorts entries: faster as int32.
        encoded = functional.embedding_bag(
            entry.int().view(-1, 8), self.table, mode="sum", per_sample_weights=weight.view(-1, 8)
        )
        return encoded.unflatten(0, (*points.shape[:-1], -1))


def _network(inputs: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(inputs, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, outputs, bias=False)
    )
