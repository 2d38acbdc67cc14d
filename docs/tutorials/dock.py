"""The loop of camera_loop.md: pictures, markers, inputs."""

import cv2
import numpy as np

import nmm

PIXELS, SIZE, DT = [525.0, 525.0, 319.5, 239.5], (640, 480), 0.02
#: The markers' middles on the board, which stands at x = 2 m and faces the robot: to the left, up, m.
MIDDLES = np.array([[0.15, 0.15], [-0.15, 0.15], [-0.15, -0.15], [0.15, -0.15]])
MARKER, DOTS = 0.12, 1000  # m; dots a metre on the printed board
BOARD = [[2.0, y, 0.6 + z] for y, z in MIDDLES]
MARKERS = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
DETECTOR = cv2.aruco.ArucoDetector(MARKERS)


def printed() -> np.ndarray:
    """The board, 0.5 m wide and high, as it comes from the printer."""
    side, board = round(MARKER * DOTS), np.full((DOTS // 2, DOTS // 2), 255, np.uint8)
    for k, (y, z) in enumerate(MIDDLES):
        column, row = (round((0.25 - one) * DOTS - 0.5 * side) for one in (y, z))
        board[row : row + side, column : column + side] = cv2.aruco.generateImageMarker(MARKERS, k, side)
    return board


def photo(board: np.ndarray, robot: nmm.Robot, q: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """What the camera sees of it: the plane's homography, out of focus a little, with a sensor's noise."""
    seen_by = nmm.Configuration(robot, q).placement("camera_optical_frame")
    corner, across, down = (
        seen_by.rotation.T @ one
        for one in (np.array([2.0, 0.25, 0.85]) - seen_by.translation, [0, -1 / DOTS, 0], [0, 0, -1 / DOTS])
    )
    fx, fy, cx, cy = PIXELS
    K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    to_picture = K @ np.column_stack([across, down, corner + 0.5 * (across + down)])
    picture = cv2.warpPerspective(board, to_picture, SIZE, flags=cv2.INTER_AREA, borderValue=90)
    picture = cv2.GaussianBlur(picture, (3, 3), 0.8)
    return np.clip(picture + rng.normal(0.0, 3.0, picture.shape), 0, 255).astype(np.uint8)


def found_in(picture: np.ndarray) -> np.ndarray:
    """Where the markers' middles are, (4, 2) px; not numbers for those that are not found."""
    found = np.full((4, 2), np.nan)
    corners, numbers, _ = DETECTOR.detectMarkers(picture)
    for four, number in zip(corners, [] if numbers is None else numbers.ravel(), strict=True):
        (a, b, c, d) = four[0].astype(float)
        across, other = np.cross([*a, 1.0], [*c, 1.0]), np.cross([*b, 1.0], [*d, 1.0])
        point = np.cross(across, other)  # where the diagonals meet, which perspective keeps
        if number < 4:
            found[number] = point[:2] / point[2]
    return found


robot, rng, board = nmm.load("unicycle_pan_tilt"), np.random.default_rng(0), printed()
measured = nmm.MeasuredPoints(BOARD, intrinsics=PIXELS, depth=1.7, observed=True)
goal = [319.5, 239.5, np.log(525 * np.sqrt(2) * 0.15)]  # in the middle, as large as 1 m ahead
task = nmm.Task(nmm.ImageMoments(measured, intrinsics=PIXELS), goal, gain=0.7)
straight = nmm.Quadratic(nmm.QuadraticTerm("pan", 0.0))
controller = nmm.Controller(robot, task, nmm.ReducedGradient(alpha=1.0), straight, limits=nmm.Limits(), dt=DT)
exact = nmm.ImagePoints(BOARD, intrinsics=PIXELS)

q, waiting, off, markers = robot.q({"x": -0.5, "y": 0.9, "theta": -0.2, "pan": -0.1}), [], [], 0
for k in range(600):
    t = k * DT
    if k % 2 == 0:  # 25 pictures a second; each takes 0.08 s until its markers are known
        seen, true = (
            found_in(photo(board, robot, q, rng)),
            nmm.evaluate(exact, t, nmm.Configuration(robot, q)),
        )
        waiting.append((k + 4 if k else 0, seen, t, q))
        off.append(seen - true.value.reshape(4, 2))
        markers += int(np.isfinite(seen[:, 0]).sum())
    while waiting and waiting[0][0] <= k:
        measured.set(*waiting.pop(0)[1:])
    q, u = controller.step(t, q, DT, "zoh")

end = nmm.evaluate(nmm.ImageMoments(BOARD, intrinsics=PIXELS), 0.0, nmm.Configuration(robot, q)).value - goal
print(f"{markers} of {4 * len(off)} markers found, to {np.sqrt(np.nanmean(np.square(off))):.2f} px")
print(f"at the end the board is {abs(end[0]):.2f} and {abs(end[1]):.2f} px from the middle")
print(f"and {100 * abs(end[2]):.2f} % from its size")
