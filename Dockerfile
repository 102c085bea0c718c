# servogen as an image: docker build -t servogen . && docker run --rm -v "$PWD:/work" servogen check my-arm.toml
FROM python:3.11-slim

# What the tested versions need comes from wheels: no compiler, no git.
WORKDIR /opt/servogen
COPY constraints.txt pyproject.toml hatch_build.py README.md LICENSE ./
COPY servogen servogen
COPY templates templates
RUN pip install --no-cache-dir -c constraints.txt '.[plot,symbolic]'

# Compile the simulator's loop once, for every user of the image. It is made for the processor that builds the
# image; on another one the first command compiles it again, which takes ten seconds.
COPY firmware/lab8-exercise/main.hex /opt/servogen/warm-up.hex
RUN servogen simulate /opt/servogen/warm-up.hex --seconds 0.1

# The files are those of the folder mounted at /work; -u "$(id -u)" makes them yours.
WORKDIR /work
ENTRYPOINT ["servogen"]
CMD ["--help"]
