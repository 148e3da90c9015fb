# Deixis on a CPU. Build it, then train and test, which are the two lines of README:
#   docker build -t deixis .
#   mkdir -p outputs && docker run --rm --user "$(id -u)" -e HOME=/tmp -v "$PWD/outputs:/deixis/outputs" deixis
#   docker run --rm deixis pytest
# --user lets the run write to your folder. The CPU build of PyTorch comes from its own index.
FROM python:3.11-slim

# ffmpeg comes with a wheel; PyBullet's software renderer needs no display.
RUN useradd --create-home deixis && mkdir /deixis && chown deixis /deixis
USER deixis
ENV PATH=/home/deixis/venv/bin:$PATH USER=deixis PIP_NO_CACHE_DIR=1 MPLBACKEND=Agg
RUN chmod 755 /home/deixis && python -m venv /home/deixis/venv
WORKDIR /deixis
COPY --chown=deixis . .
RUN pip install --extra-index-url https://download.pytorch.org/whl/cpu -e ".[test]"
CMD ["python", "train.py"]
