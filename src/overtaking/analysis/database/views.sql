-- The source paper's entities, in its units and with its names, as views of our tables.
--
-- A tuple of the paper becomes a column for each part. Vehicles have the numbers of our tables, in
-- which the ego is 0. CARLA's axes are left-handed: what turns or lies to the left is negative there.

CREATE VIEW paper.Simulations AS
SELECT simulation AS S, 0 AS IDego, num_vehicles AS NV, weather AS W, class AS CLASS
FROM main.simulations LEFT JOIN main.labels USING (simulation)
WHERE policy = 'paper';

CREATE VIEW paper.Weather AS
SELECT weather AS W, rain_percent AS Prec, fog_percent AS Fog, wind_percent AS Wind,
    CASE WHEN night THEN 'Night' ELSE 'Day' END AS DN,
    CASE WHEN low_sun THEN 'Yes' ELSE 'No' END AS HL
FROM main.weather;

CREATE VIEW paper.Frames AS
SELECT simulation AS S, frame AS F, time_ms / 1000.0::DOUBLE AS TS FROM main.frames;

CREATE VIEW paper.EgoVehicle AS
SELECT simulation AS S, frame AS F, 0 AS IDego, speed_limit_mps * 3.6::DOUBLE AS MV,
    right_line AS RT, left_line AS LT, lane_width_m AS LW,
    right_lane_width_m AS LWR, left_lane_width_m AS LWL, collided_with AS C,
    CAST(lane_change_begins AS INTEGER) AS OV
FROM main.frames;

CREATE VIEW paper.Vehicles AS
SELECT simulation AS S, frame AS F, vehicle AS ID, kind AS Type, colour AS Colour,
    length_m AS DimLength, width_m AS DimWidth, height_m AS DimHeight,
    x_mm / 1000.0::DOUBLE AS Lx, -y_mm / 1000.0::DOUBLE AS Ly, lane_id AS Llane,
    speed_mmps * 0.0036::DOUBLE AS V,
    -degrees(wheel_angle_100urad / 10000.0) AS Dwheel,
    -degrees(heading_100urad / 10000.0) AS Dyaw,
    sqrt(accel_lon_mmps2::DOUBLE ** 2 + accel_lat_mmps2::DOUBLE ** 2) / 1000.0 AS A
FROM main.states JOIN main.vehicles USING (simulation, vehicle);
