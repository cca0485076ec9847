"""The one page of conventions: axes, units, letters and shared constants. Nothing here depends on torch.

Axes        world is right-handed in scene units; cameras are OpenCV (x right, y down, z forward).
Matrices    named after their map: p_camera = world_to_camera @ p_world. At the rasterizer: viewmats [C, 4, 4].
Pixels      centres lie at +0.5; Ks belong to a stated image size. Images are [H, W, 3], display-encoded RGB.
Gaussians   means [N, 3], quats [N, 4] wxyz, scales [N, 3] linear standard deviations, opacities [N] in 0..1,
            colors [N, 3] in 0..1.
Time        frame_index counts the capture, clip_index the clips, frame_in_clip the frames of a clip;
            clip_time = frame_in_clip / clip_length, in [0, 1).
Letters     N Gaussians, A anchors, K Gaussians per anchor, F features, C cameras, H W image size, M frames per clip.
"""

ALPHA_MIN = 1.0 / 255.0
"""A Gaussian contributes to a pixel only where its alpha reaches this."""
ALPHA_MAX = 0.999
"""Alpha is capped here, so that transmittance never becomes exactly zero."""
TRANSMITTANCE_MIN = 1e-4
"""A pixel is finished once the transmittance in front of the next Gaussian is below this."""
EPS2D_PX2 = 0.3
"""Low-pass added to both diagonal entries of the projected covariance, square pixels."""
FRUSTUM_MARGIN = 0.15
"""The slope x/z used in the projection Jacobian is clamped this share of the image beyond its borders."""
