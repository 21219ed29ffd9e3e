# docker build -t swingid . && docker run --rm -p 8080:8080 -v "$PWD:/data" swingid
# The page is at http://localhost:8080 with the token that is printed; any command: docker run … swingid identify log.csv --rig rig.toml
FROM python:3.13-slim
COPY . /src
RUN pip install --no-cache-dir "/src[app,formats,pdf,live]" && rm -r /src && useradd --create-home lab && mkdir /data && chown lab /data
USER lab
WORKDIR /data
EXPOSE 8080
ENTRYPOINT ["swingid"]
CMD ["dashboard", "--host", "0.0.0.0", "--no-browser"]
